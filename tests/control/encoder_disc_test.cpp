// Eccentric discs: what is learnt of them from coasting wheels, and what it saves the observer.
#include "control/encoder_disc.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>

#include "catch.hpp"
#include "control/tracking_observer.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

constexpr std::int32_t counts_per_rev = 4096;
constexpr double rad_per_count = 2.0 * std::numbers::pi / counts_per_rev;

/// What an eccentric disc reads; written apart from the simulator's encoder.
std::int32_t reading(double angle_rad, const rig::EccentricityParameters& disc) {
  const double read_rad = angle_rad + disc.eccentricity_rad * std::sin(angle_rad + disc.phase_rad);
  return static_cast<std::int32_t>(static_cast<std::int64_t>(std::floor(read_rad / rad_per_count)));
}

/// A wheel that coasts: bearing friction with a part that grows with the speed.
double coasting_rad(double time_s) {
  return 0.3 + 165.0 * time_s - 0.5 * 9.0 * time_s * time_s + 0.02 * std::pow(time_s, 3);
}

/// Largest error of the observer's speed at a constant 120 rad/s, after it has settled.
double largest_error_rad_s(const rig::EccentricityParameters& disc, const rig::EccentricityParameters& known) {
  control::TrackingObserver observer(control::ObserverOptions{}, counts_per_rev,
                                     std::numeric_limits<double>::infinity(), known);
  observer.reset(reading(0.2, disc), 120.0);
  double largest = 0.0;
  for (int tick = 1; tick < 1000; ++tick) {
    observer.update(reading(0.2 + 120.0 * 1e-3 * tick, disc), 1e-3);
    if (tick > 200) largest = std::max(largest, std::abs(observer.omega_rad_s() - 120.0));
  }
  return largest;
}

}  // namespace

TEST_CASE("The fit finds the eccentricity of a coasting wheel within a tenth of a count") {
  const double e = GENERATE(0.0, 3e-3, 1e-2, 3e-2);
  const double phase = GENERATE(-2.5, 0.4, 3.0);
  const std::int32_t start = GENERATE(0, -3'000'000);
  control::EccentricityFit fit(0.4, counts_per_rev);
  std::optional<rig::EccentricityParameters> found;
  int results = 0;
  for (int tick = 0; tick <= 900; ++tick) {
    const std::int32_t counts = start + reading(coasting_rad(tick * 1e-3), {e, phase});
    if (const auto result = fit.take(tick * std::int64_t{1'000'000}, counts)) {
      found = result;
      ++results;
    }
  }
  CHECK(results == 2);
  REQUIRE(found);
  const double turned = (start % counts_per_rev) * rad_per_count;
  CHECK_THAT(found->eccentricity_rad * std::cos(found->phase_rad),
             WithinAbs(e * std::cos(phase - turned), 0.1 * rad_per_count));
  CHECK_THAT(found->eccentricity_rad * std::sin(found->phase_rad),
             WithinAbs(e * std::sin(phase - turned), 0.1 * rad_per_count));
}

TEST_CASE("Less than a quarter of a count is none") {
  const double part = GENERATE(0.0, 0.15, 0.35);
  control::EccentricityFit fit(0.4, counts_per_rev);
  std::optional<rig::EccentricityParameters> found;
  for (int tick = 0; tick <= 400; ++tick) {
    const auto result =
        fit.take(tick * std::int64_t{1'000'000}, reading(coasting_rad(tick * 1e-3), {part * rad_per_count, 1.0}));
    if (result) found = result;
  }
  REQUIRE(found);
  CHECK((found->eccentricity_rad == 0.0) == (part < 0.25));
}

TEST_CASE("A block in which the torque jumps teaches nothing, a steady motor does") {
  const double jump_rad_s2 = GENERATE(0.0, 20.0, -100.0);
  control::EccentricityFit fit(0.4, counts_per_rev);
  std::optional<rig::EccentricityParameters> found;
  for (int tick = 0; tick <= 400; ++tick) {
    const double t = tick * 1e-3;
    // A motor with back-EMF from 60 rad/s towards 190 rad/s in 4 s, and the jump after half of the block.
    const double run_up_rad = 190.0 * t - 130.0 * 4.0 * (1.0 - std::exp(-t / 4.0));
    const double jumped_rad = 0.5 * jump_rad_s2 * std::pow(std::max(0.0, t - 0.2), 2);
    const auto result = fit.take(tick * std::int64_t{1'000'000}, reading(run_up_rad + jumped_rad, {0.01, 0.4}));
    if (result) found = result;
  }
  REQUIRE(found.has_value() == (jump_rad_s2 == 0.0));
  if (found) CHECK_THAT(found->eccentricity_rad, WithinAbs(0.01, 0.1 * rad_per_count));
}

TEST_CASE("A wheel that hardly turns teaches nothing") {
  control::EccentricityFit fit(0.4, counts_per_rev);
  for (int tick = 0; tick <= 2000; ++tick) {
    CHECK_FALSE(fit.take(tick * std::int64_t{1'000'000}, reading(15.0 * tick * 1e-3, {0.01, 1.0})));
  }
}

TEST_CASE("Eccentricity swings the observed speed by e w, and the correction takes the swing away") {
  const rig::EccentricityParameters disc{0.01, 0.7};
  const double wrong = largest_error_rad_s(disc, {});
  const double right = largest_error_rad_s(disc, disc);
  // e w = 1.2 rad/s at 120 rad/s, through the observer with its triple pole at 150 rad/s, whose
  // transfer function from speed to estimate is (3 a^2 s + a^3) / (s + a)^3 at s = 120i.
  const std::complex<double> s(0.0, 120.0);
  const double a = 150.0;
  const double gain = std::abs((3.0 * a * a * s + a * a * a) / std::pow(s + a, 3));
  CHECK_THAT(wrong, WithinAbs(1.2 * gain, 0.15));
  CHECK(right < 0.1 * wrong);  // what the counts alone leave
}

TEST_CASE("What is learnt takes effect without a step of the speed") {
  const rig::EccentricityParameters disc{0.02, 0.7};
  control::TrackingObserver observer(control::ObserverOptions{}, counts_per_rev);
  observer.reset(reading(0.0, disc), 120.0);
  for (int tick = 1; tick < 500; ++tick) observer.update(reading(0.12 * tick, disc), 1e-3);
  const double before = observer.omega_rad_s();
  observer.know(disc);
  CHECK(observer.omega_rad_s() == before);
  for (int tick = 500; tick < 700; ++tick) observer.update(reading(0.12 * tick, disc), 1e-3);
  CHECK_THAT(observer.omega_rad_s(), WithinAbs(120.0, 0.2));
}

TEST_CASE("A disc without eccentricity passes the counts on, also where the counter wraps around") {
  control::EncoderDisc disc({}, counts_per_rev);
  std::int32_t counts = -17;
  disc.reset(counts);
  for (const std::int32_t travel : {0, 5, -5, 4096, -100'000, 2'000'000'000, 2'000'000'000}) {
    counts = static_cast<std::int32_t>(static_cast<std::uint32_t>(counts) + static_cast<std::uint32_t>(travel));
    CHECK(disc.take(counts) == travel);
  }
}

TEST_CASE("Whole turns of an eccentric disc are whole turns of the wheel, also where the counter wraps around") {
  // 4096 divides 2^32, and 1000 does not.
  const std::int32_t per_rev = GENERATE(4096, 1000);
  control::EncoderDisc disc({0.02, 0.7}, per_rev);
  std::int32_t counts = 123;
  disc.reset(counts);
  for (int turn = 0; turn < 3000; ++turn) {
    for (const std::int32_t part : {per_rev * 300, per_rev * 400}) {
      counts = static_cast<std::int32_t>(static_cast<std::uint32_t>(counts) + static_cast<std::uint32_t>(part));
      REQUIRE(disc.take(counts) == part);
    }
  }
}

TEST_CASE("What an observer ignores of an eccentric disc counts in its travel, and in the next reading") {
  const rig::EccentricityParameters disc{0.01, 0.7};
  control::TrackingObserver observer(control::ObserverOptions{}, counts_per_rev, 343.0, disc);
  observer.reset(reading(0.0, disc), 120.0);
  double turned_rad = 0.0;
  double angle_rad = 0.0;
  for (int tick = 1; tick < 800; ++tick) {
    const bool late = tick % 100 == 0;  // its counts are those of 3 ms later, and its stamp may be as wrong
    angle_rad = 0.12 * tick;
    observer.update(reading(late ? angle_rad + 0.36 : angle_rad, disc), 1e-3, late ? 3e-3 : 0.0);
    turned_rad += observer.travel_rad();
    if (tick > 200) CHECK_THAT(observer.omega_rad_s(), WithinAbs(120.0, 0.2));
  }
  CHECK_THAT(turned_rad, WithinAbs(angle_rad, 2.0 * rad_per_count));
}

// Encoders: counts, wraps, and discs with flaws.
#include "plant_sim/encoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "catch.hpp"
#include "rig/encoder_scale.hpp"

using abs_hil::rig::counts_between;
using abs_hil::rig::radians_per_count;
using Catch::Matchers::WithinAbs;

using abs_hil::plant_sim::Encoder;

namespace {

std::int32_t encoder_counts(double angle_rad, std::int32_t counts_per_rev) {
  return Encoder(counts_per_rev, {}, {}).counts(angle_rad);
}

std::int32_t reading_at(double counts, std::int32_t counts_per_rev = 4096) {
  return encoder_counts(counts * radians_per_count(counts_per_rev), counts_per_rev);
}

constexpr std::int32_t highest = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t lowest = std::numeric_limits<std::int32_t>::min();

}  // namespace

TEST_CASE("A reading is the floor of the angle, below zero too") {
  CHECK(encoder_counts(0.0, 4096) == 0);
  CHECK(reading_at(0.999) == 0);
  CHECK(reading_at(1.001) == 1);
  CHECK(reading_at(-0.001) == -1);
  CHECK(reading_at(-0.999) == -1);
  CHECK(reading_at(-1.001) == -2);
  CHECK(reading_at(4096.5) == 4096);
  CHECK(reading_at(10.5, 4) == 10);
}

TEST_CASE("The counter wraps at 32 bits in both directions") {
  const double span = 4294967296.0;
  CHECK(reading_at(0.5 * span - 0.5) == highest);
  CHECK(reading_at(0.5 * span + 0.5) == lowest);
  CHECK(reading_at(-0.5 * span + 0.5) == lowest);
  CHECK(reading_at(-0.5 * span - 0.5) == highest);
  CHECK(reading_at(span + 7.5) == 7);
  CHECK(reading_at(-span - 7.5) == -8);
  CHECK(reading_at(1000.0 * span + 123.5) == 123);
}

TEST_CASE("Differences of readings are exact across the wrap and back") {
  const double near_wrap = 2147483640.5;
  for (int travel = -20; travel <= 20; ++travel) {
    CHECK(counts_between(reading_at(near_wrap), reading_at(near_wrap + travel)) == travel);
    CHECK(counts_between(reading_at(near_wrap + travel), reading_at(near_wrap)) == -travel);
  }
}

using namespace abs_hil::plant_sim;

namespace {

/// Speed by an encoder over one tick, the wheel turning at `omega_rad_s` from `angle_rad`.
double read_speed_rad_s(const Encoder& encoder, double angle_rad, double omega_rad_s, double tick_s) {
  const std::int64_t before = encoder.position(angle_rad);
  const std::int64_t after = encoder.position(angle_rad + omega_rad_s * tick_s);
  return static_cast<double>(after - before) * radians_per_count(1'000'000) / tick_s;
}

}  // namespace

TEST_CASE("Eccentricity makes the speed swing by eccentricity times speed, once a turn") {
  constexpr double e = 0.01;
  constexpr double phase = 0.8;
  constexpr double omega = 100.0;
  const Encoder encoder(1'000'000, {.eccentricity_rad = e, .phase_rad = phase}, {});
  double largest = 0.0;
  for (int i = 0; i < 200; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 200.0;
    const double speed = read_speed_rad_s(encoder, angle - 0.005, omega, 1e-4);
    largest = std::max(largest, speed - omega);
    // The difference quotient is the slope in the middle of the tick, within its count.
    CHECK_THAT(speed, WithinAbs(omega * (1.0 + e * std::cos(angle + phase)), 0.07));
  }
  CHECK_THAT(largest, WithinAbs(e * omega, 0.07));
}

TEST_CASE("Both encoders may have an eccentricity beside their own, each in its phase") {
  PlantOptions plant;
  plant.encoder_eccentricity_rad = 0.02;
  plant.rig.upper_encoder = {.eccentricity_rad = 0.01, .phase_rad = 0.5};
  plant.rig.lower_encoder.phase_rad = 2.0;
  const Encoder upper(4096, {.eccentricity_rad = 0.03, .phase_rad = 0.5}, {});
  const Encoder lower(4096, {.eccentricity_rad = 0.02, .phase_rad = 2.0}, {});
  for (double angle = 0.0; angle < 7.0; angle += 0.1) {
    CHECK(upper_encoder(plant).counts(angle) == upper.counts(angle));
    CHECK(lower_encoder(plant).counts(angle) == lower.counts(angle));
  }
}

TEST_CASE("Unequal slots move every second edge and lose no count") {
  const Encoder encoder(8, {}, {.slot_error_counts = 0.3});
  const double count = radians_per_count(8);
  for (std::int64_t k = -20; k < 20; ++k) {
    const double late = (k & 1) != 0 ? 0.3 : 0.0;
    CHECK(encoder.position((static_cast<double>(k) + late - 1e-6) * count) == k - 1);
    CHECK(encoder.position((static_cast<double>(k) + late + 1e-6) * count) == k);
  }
}

TEST_CASE("A dirty place loses its counts in every turn, and gives them back in reverse") {
  const Encoder encoder(100, {.phase_rad = 1.0}, {.lost_counts = 3});
  const double count = radians_per_count(100);
  const auto at = [&](std::int64_t edge) { return encoder.position((static_cast<double>(edge) + 0.5) * count); };
  CHECK(at(0) == 0);
  for (std::int64_t turns = -4; turns <= 4; ++turns) CHECK(at(100 * turns) == 97 * turns);
  int standing = 0;
  for (std::int64_t edge = -300; edge < 300; ++edge) {
    const std::int64_t step = at(edge + 1) - at(edge);
    CHECK((step == 0 || step == 1));
    standing += step == 0 ? 1 : 0;
  }
  CHECK(standing == 6 * 3);
}

TEST_CASE("An encoder without flaws reads the floor of the angle") {
  const Encoder encoder(4096, {}, {});
  const double count = radians_per_count(4096);
  for (double angle = -3.0; angle < 3.0; angle += 0.00137) {
    CHECK(encoder.counts(angle, 0.25 * count) == static_cast<std::int32_t>(std::floor((angle + 0.25 * count) / count)));
  }
}

// What time stamps of a counter's edges are worth: noise of the estimated slip at low speed, with the edges of an ideal
// disc and of one whose edges are displaced.

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "catch.hpp"
#include "control/tracking_observer.hpp"

using namespace abs_hil;

namespace {

constexpr std::int32_t per_rev = 4096;
constexpr double per_rad = per_rev / (2.0 * std::numbers::pi);
constexpr double period_s = 1e-3;
constexpr double decelerated_rad_s2 = -2.0;

double turned_rad(double speed_rad_s, double t_s) { return speed_rad_s * t_s + decelerated_rad_s2 * t_s * t_s / 2; }

/// An encoder whose edge n lies at n + `displaced_counts` times -1 to 1, repeating every four edges as the phases of a
/// quadrature encoder do.
struct Disc {
  double displaced_counts{0.0};

  [[nodiscard]] double edge(std::int64_t n) const {
    constexpr std::array<double, 4> share{1.0, -0.4, -1.0, 0.4};
    return static_cast<double>(n) + displaced_counts * share[static_cast<std::size_t>(n & 3)];
  }
  [[nodiscard]] std::int64_t counted(double counts) const {
    auto n = static_cast<std::int64_t>(std::floor(counts)) + 2;
    while (edge(n) > counts) --n;
    return n;
  }
};

/// A wheel that slows down from `start_rad_s`, seen through a disc.
struct Wheel {
  double start_rad_s;
  Disc disc;
  control::TrackingObserver observer{control::ObserverOptions{}, per_rev};

  void read(double t_s, bool stamped) {
    const double counts = turned_rad(start_rad_s, t_s) * per_rad;
    const std::int64_t n = disc.counted(counts);
    // The edge's time by the closed form of the motion.
    const double angle_rad = disc.edge(n) / per_rad;
    const double root = std::sqrt(start_rad_s * start_rad_s + 2.0 * decelerated_rad_s2 * angle_rad);
    const double edge_s = (root - start_rad_s) / decelerated_rad_s2;
    observer.update(static_cast<std::int32_t>(n), period_s, 0.0, stamped ? t_s - edge_s : -1.0);
  }
};

/// Root mean square of the estimated slip less the true one while the wheels slow down from 5 to 3 rad/s.
double slip_noise(double displaced_counts, bool stamped) {
  Wheel upper{5.2, {displaced_counts}}, lower{6.0, {displaced_counts}};
  upper.observer.reset(0, 5.2);
  lower.observer.reset(0, 6.0);
  double square = 0.0;
  int readings = 0;
  for (int n = 1; n * period_s < 1.5; ++n) {
    const double t_s = n * period_s;
    upper.read(t_s, stamped);
    lower.read(t_s, stamped);
    if (t_s < 0.5) continue;
    const double slip = 1.0 - upper.observer.omega_rad_s() / lower.observer.omega_rad_s();
    const double is = 1.0 - (5.2 + decelerated_rad_s2 * t_s) / (6.0 + decelerated_rad_s2 * t_s);
    square += (slip - is) * (slip - is);
    ++readings;
  }
  return std::sqrt(square / readings);
}

}  // namespace

TEST_CASE("Stamps of an ideal disc's edges remove the counting's noise from the slip at 3 to 5 rad/s") {
  const double without = slip_noise(0.0, false);
  const double with = slip_noise(0.0, true);
  CAPTURE(without, with);
  CHECK(without > 3e-3);
  CHECK(with < without / 100.0);
}

TEST_CASE("Stamps gain less where the disc's edges are displaced, and do not harm") {
  for (const auto& [displaced_counts, gain] : {std::pair{0.05, 8.0}, {0.1, 4.0}, {0.2, 2.0}, {0.4, 1.3}}) {
    const double without = slip_noise(displaced_counts, false);
    const double with = slip_noise(displaced_counts, true);
    CAPTURE(displaced_counts, without, with);
    CHECK(with * gain < without);
  }
}

TEST_CASE("Without stamps the estimate is what it was, bit by bit") {
  control::TrackingObserver plain{control::ObserverOptions{}, per_rev}, unknown{control::ObserverOptions{}, per_rev};
  plain.reset(0, 5.0);
  unknown.reset(0, 5.0);
  for (int n = 1; n < 2000; ++n) {
    const auto counts = static_cast<std::int32_t>(std::floor(turned_rad(5.0, n * period_s) * per_rad));
    plain.update(counts, period_s);
    unknown.update(counts, period_s, 0.0, -1e-9);
    REQUIRE(plain.omega_rad_s() == unknown.omega_rad_s());
  }
}

TEST_CASE("A stamp cannot place the wheel outside its count, however wrong it is") {
  // A stamp of 2 s at 100 rad/s would mean 130,000 counts.
  control::TrackingObserver plain{control::ObserverOptions{}, per_rev}, lied{control::ObserverOptions{}, per_rev};
  plain.reset(0, 100.0);
  lied.reset(0, 100.0);
  double worst_rad_s = 0.0;
  for (int n = 1; n < 500; ++n) {
    const auto counts = static_cast<std::int32_t>(std::floor(100.0 * n * period_s * per_rad));
    plain.update(counts, period_s);
    lied.update(counts, period_s, 0.0, n % 3 == 0 ? 2.0 : 0.0);
    worst_rad_s = std::max(worst_rad_s, std::abs(plain.omega_rad_s() - lied.omega_rad_s()));
  }
  CHECK(worst_rad_s < 0.5);
}

TEST_CASE("A wheel that turns backwards is placed by the other side of its count") {
  const auto last_rad_s = [](double direction) {
    control::TrackingObserver observer{control::ObserverOptions{}, per_rev};
    observer.reset(0, direction * 4.0);
    for (int n = 1; n < 1000; ++n) {
      const double counts = 4.0 * n * period_s * per_rad;
      const double since_edge_s = (counts - std::floor(counts)) / (4.0 * per_rad);
      const auto whole = static_cast<std::int32_t>(std::floor(counts));
      observer.update(direction > 0 ? whole : -whole, period_s, 0.0, since_edge_s);
    }
    return observer.omega_rad_s();
  };
  CHECK(std::abs(last_rad_s(1.0) - 4.0) < 1e-4);
  CHECK(last_rad_s(-1.0) == -last_rad_s(1.0));
}

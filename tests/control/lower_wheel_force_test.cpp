// The tyre force and the speeds that the travels of the wheels give, late by three known lags.

#include "control/lower_wheel_force.hpp"

#include <algorithm>
#include <cmath>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double period_s = 1e-3;

double force_at(double t) { return t < 0.05 ? 400.0 * t : 20.0 + 5.0 * std::sin(40.0 * (t - 0.05)); }

/// Angle that the lower wheel turns in each period under `force_at`: the equation of motion in steps of a microsecond.
class LowerWheel {
 public:
  double omega_rad_s{170.0};
  double next_rad() {
    double angle = 0.0;
    for (int i = 0; i < 1000; ++i) {
      const double alpha =
          (-w_.r2_m * force_at(time_s_ + 0.5e-6) - w_.d2_Nms_rad * omega_rad_s - w_.M20_Nm) / w_.J2_kg_m2;
      angle += omega_rad_s * 1e-6 + 0.5 * alpha * 1e-12;
      omega_rad_s += alpha * 1e-6;
      time_s_ += 1e-6;
    }
    return angle;
  }

 private:
  rig::WheelParameters w_{};
  double time_s_{0.0};
};

}  // namespace

TEST_CASE("The lower wheel's angle alone gives the tyre force, late by three known lags") {
  const rig::WheelParameters wheels;
  LowerWheel wheel;
  control::LowerWheelForce force{wheels, 150.0};
  control::ForceDelay<double> late, too_late;
  force.reset(wheel.omega_rad_s);
  double largest_error = 0.0, largest_shifted = 0.0, before = 0.0;
  for (int n = 1; n <= 400; ++n) {
    const double travel = wheel.next_rad();
    force.update(period_s, travel, wheel.omega_rad_s);
    const double now = force_at(n * period_s);
    largest_error = std::max(largest_error, std::abs(force.force_N() - late(force.covered(), now)));
    largest_shifted = std::max(largest_shifted, std::abs(force.force_N() - too_late(force.covered(), before)));
    before = now;
  }
  CHECK(largest_error < 0.02);
  CHECK(largest_shifted > 0.2);  // one cycle more would be seen
}

TEST_CASE("Cycles of unequal length do not change the force that the lower wheel gives") {
  const rig::WheelParameters wheels;
  control::LowerWheelForce force{wheels, 150.0};
  const double force_N = 20.0;
  double omega = 170.0;
  force.reset(omega);
  for (int n = 0; n < 400; ++n) {
    const double dt_s = n % 2 == 0 ? 0.7e-3 : 1.3e-3;
    const double alpha = (-wheels.r2_m * force_N - wheels.d2_Nms_rad * 170.0 - wheels.M20_Nm) / wheels.J2_kg_m2;
    force.update(dt_s, omega * dt_s + 0.5 * alpha * dt_s * dt_s, 170.0);
    omega += alpha * dt_s;
  }
  CHECK_THAT(force.force_N(), WithinRel(force_N, 1e-6));
}

TEST_CASE("Delayed speeds are as late as the force") {
  control::DelayedSpeeds delayed;
  control::ForceDelay<double> late;
  const double q = 0.15;
  // Speeds that rise in proportion to the time: the mean of an interval is that of its ends.
  delayed.reset({.omega1_rad_s = 0.0, .omega2_rad_s = 0.0});
  for (int n = 1; n <= 300; ++n) {
    const double now = 0.4 * n, before = 0.4 * (n - 1);
    delayed.update(q, period_s, 0.5 * (now + before) * period_s, (now + before) * period_s);
    CAPTURE(n);
    const double expected = late(q, now);
    CHECK_THAT(delayed.speeds().omega1_rad_s, WithinAbs(expected, 1e-12 * now));
    CHECK_THAT(delayed.speeds().omega2_rad_s, WithinAbs(2.0 * expected, 1e-12 * now));
  }
}

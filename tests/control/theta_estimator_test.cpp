#include "control/theta_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

const rig::WheelParameters wheels{};

control::AdaptiveOptions unbounded() {
  control::AdaptiveOptions options;
  options.theta_min_N = -1e9;
  options.theta_max_N = 1e9;
  return options;
}

/// Interval in which the wheel turns at constant speed under theta phi: brake and friction just balance the tyre.
control::AdaptationInterval balanced(double dt_s, double theta_N, double phi) {
  const double omega1 = 100.0;
  return {.dt_s = dt_s,
          .omega1_before_rad_s = omega1,
          .omega1_after_rad_s = omega1,
          .brake_torque_Nm = wheels.r1_m * theta_N * phi - wheels.d1_Nms_rad * omega1 - wheels.M10_Nm,
          .phi = phi};
}

}  // namespace

TEST_CASE("It is the estimator (17)-(18): zeta and omega1_hat integrated as they stand give the same estimate") {
  auto options = unbounded();
  options.zeta0 = 3.0;
  control::ThetaEstimator estimator{options, wheels};
  const double g = options.gamma * options.ka1 * wheels.J1_kg_m2 / wheels.r1_m;
  const double h = 2e-3;
  double omega1 = 160.0, zeta = options.zeta0, omega1_hat = omega1;
  for (int n = 0; n < 300; ++n) {
    const double t = n * h, phi = 0.6 + 0.4 * std::sin(9 * t), torque = 4 + 3 * std::cos(17 * t);
    const double slope = -60 + 30 * std::sin(5 * t), weighted = 0.3 * std::cos(11 * t);
    estimator.update({.dt_s = h,
                      .omega1_before_rad_s = omega1,
                      .omega1_after_rad_s = omega1 + slope * h,
                      .brake_torque_Nm = torque,
                      .phi = phi,
                      .weighted_error = weighted});
    const int fine = 200;
    for (int i = 0; i < fine; ++i) {  // midpoint rule on the printed equations, plus sign
      const double s = h / fine;
      const auto observer_rate = [&](double w1, double w1_hat, double z) {
        const double theta_hat = z + g * (w1 - w1_hat);
        return wheels.r1_m / wheels.J1_kg_m2 * theta_hat * phi -
               (wheels.d1_Nms_rad * w1 + wheels.M10_Nm + torque) / wheels.J1_kg_m2;
      };
      const double zeta_rate = -options.gamma * phi * weighted;
      const double half = omega1_hat + s / 2 * observer_rate(omega1, omega1_hat, zeta);
      omega1_hat += s * observer_rate(omega1 + slope * s / 2, half, zeta + zeta_rate * s / 2);
      omega1 += slope * s;
      zeta += zeta_rate * s;
    }
    const double theta_hat = zeta + g * (omega1 - omega1_hat);
    REQUIRE_THAT(estimator.theta_N(), WithinAbs(theta_hat, 2e-3 * (1 + std::abs(theta_hat))));
  }
}

TEST_CASE("The plus sign converges at the rate gamma ka1 phi, the sign printed in (18) diverges at it") {
  // The printed minus before gamma ka1 is the same code with ka1 negative.
  const double theta = 23.0, phi = 0.78, dt = 1e-3, error0 = 1.0;
  for (const double sign : {1.0, -1.0}) {
    auto options = unbounded();
    options.ka1 = sign;
    options.zeta0 = theta - error0;
    control::ThetaEstimator estimator{options, wheels};
    for (int n = 1; n <= 400; ++n) {
      estimator.update(balanced(dt, theta, phi));
      const double expected = error0 * std::exp(-sign * options.gamma * phi * n * dt);
      CHECK_THAT(theta - estimator.theta_N(), WithinRel(expected, 1e-6));
    }
    CHECK(std::abs(theta - estimator.theta_N()) < (sign > 0 ? 0.002 : 1e9));
    CHECK(std::abs(theta - estimator.theta_N()) > (sign > 0 ? 0.0 : 500.0));
  }
}

TEST_CASE("Large gains stay stable at 100 Hz and any jitter") {
  auto options = unbounded();
  options.gamma = 2000.0;
  options.ka1 = 5.0;
  control::ThetaEstimator estimator{options, wheels};
  for (int n = 0; n < 20; ++n) {
    estimator.update(balanced(n % 2 == 0 ? 0.01 : 0.035, 23.0, 1.0));
    CHECK((estimator.theta_N() >= 0.0 && estimator.theta_N() <= 23.0 + 1e-6));
  }
  CHECK_THAT(estimator.theta_N(), WithinAbs(23.0, 1e-6));
}

TEST_CASE("Adaptation is frozen for phi <= 0, without a jump before or after") {
  control::AdaptiveOptions options;
  control::ThetaEstimator estimator{options, wheels};
  for (int n = 0; n < 200; ++n) estimator.update(balanced(1e-3, 23.0, 0.8));
  const double before = estimator.theta_N();
  CHECK(before > 20.0);
  for (const double phi : {0.0, -0.3, -1.0}) {
    for (int n = 0; n < 100; ++n) {
      // A wheel that speeds up by 5 rad/s per cycle, and a large error: nothing of it may get in.
      estimator.update({.dt_s = 1e-3,
                        .omega1_before_rad_s = 100.0 + 5.0 * n,
                        .omega1_after_rad_s = 105.0 + 5.0 * n,
                        .brake_torque_Nm = 2.0,
                        .phi = phi,
                        .weighted_error = 3.0});
      CHECK(estimator.theta_N() == before);
    }
  }
  estimator.update(balanced(1e-3, 23.0, 0.8));
  CHECK(estimator.theta_N() > before);
  CHECK(estimator.theta_N() < before + 0.05);
}

TEST_CASE("The estimate is projected, and leaves a bound at once when the derivative points inward") {
  control::AdaptiveOptions options;
  options.theta_min_N = 5.0;
  options.theta_max_N = 30.0;
  options.zeta0 = 0.0;
  control::ThetaEstimator estimator{options, wheels};
  CHECK(estimator.theta_N() == 5.0);
  for (int n = 0; n < 3000; ++n) {  // three seconds against the upper bound
    estimator.update(balanced(1e-3, 80.0, 1.0));
    CHECK(estimator.theta_N() <= 30.0);
  }
  CHECK(estimator.theta_N() == 30.0);
  estimator.update(balanced(1e-3, 20.0, 1.0));
  CHECK_THAT(estimator.theta_N(), WithinAbs(20.0 + 10.0 * std::exp(-21.0 * 1e-3), 1e-9));
  for (int n = 0; n < 3000; ++n) estimator.update(balanced(1e-3, 0.0, 1.0));
  CHECK(estimator.theta_N() == 5.0);
  estimator.update(balanced(1e-3, 20.0, 1.0));
  CHECK(estimator.theta_N() > 5.0);
  estimator.reset();
  CHECK(estimator.theta_N() == 5.0);
}

TEST_CASE("No time and hardly any slip are harmless") {
  control::AdaptiveOptions options;
  options.zeta0 = 10.0;
  control::ThetaEstimator estimator{options, wheels};
  estimator.update(balanced(0.0, 23.0, 0.8));
  CHECK(estimator.theta_N() == 10.0);
  estimator.update(balanced(1e-3, 23.0, 1e-300));
  CHECK_THAT(estimator.theta_N(), WithinAbs(10.0, 1e-9));
  estimator.update(balanced(1e-3, 23.0, std::numeric_limits<double>::denorm_min()));
  CHECK(std::isfinite(estimator.theta_N()));
}

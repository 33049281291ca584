// The estimate of theta by (17)-(18): rates of convergence, projection, standing wheels.
#include "control/theta_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "abs_hil/control/paper_laws.hpp"
#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
namespace paper = control::paper;

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

TEST_CASE(
    "It is the estimator (17)-(18): zeta, omega1_hat and theta_hat are those of the equations integrated finely") {
  auto options = unbounded();
  options.zeta0 = 3.0;
  control::ThetaEstimator estimator{options, wheels};
  const paper::Gains<double> gains{.gamma = options.gamma, .ka1 = options.ka1};
  const auto laws = paper::laws(wheels);
  const double h = 2e-3;
  double omega1 = 160.0;
  paper::AdaptiveState<double> x{.omega1_hat = omega1, .zeta = options.zeta0};
  for (int n = 0; n < 300; ++n) {
    const double t = n * h, torque = 4 + 3 * std::cos(17 * t), slope = -60 + 30 * std::sin(5 * t);
    const double BtP_x = 0.3 * std::cos(11 * t);
    paper::Reading<double> y{.omega1 = omega1, .lambda_ref = 0.15, .phi = 0.6 + 0.4 * std::sin(9 * t)};
    const double zeta_rate = laws.zeta_dot(gains, y, BtP_x);
    estimator.update({.dt_s = h,
                      .omega1_before_rad_s = omega1,
                      .omega1_after_rad_s = omega1 + slope * h,
                      .brake_torque_Nm = torque,
                      .phi = y.phi,
                      .zeta_rate_N_s = zeta_rate});
    const int fine = 200;
    const double step = h / fine;
    for (int i = 0; i < fine; ++i) {  // midpoint rule on (17)
      y.omega1 = omega1;
      const auto half = x.omega1_hat + step / 2 * laws.omega1_hat_dot(y, laws.theta_hat(gains, x, omega1), torque);
      y.omega1 = omega1 + slope * step / 2;
      const paper::AdaptiveState<double> mid{.omega1_hat = half, .zeta = x.zeta + zeta_rate * step / 2};
      x.omega1_hat += step * laws.omega1_hat_dot(y, laws.theta_hat(gains, mid, y.omega1), torque);
      x.zeta += zeta_rate * step;
      omega1 += slope * step;
    }
    const double theta_hat = laws.theta_hat(gains, x, omega1);
    REQUIRE_THAT(estimator.theta_N(), WithinAbs(theta_hat, 2e-3 * (1 + std::abs(theta_hat))));
    REQUIRE_THAT(estimator.zeta_N(), WithinAbs(x.zeta, 1e-9 * (1 + std::abs(x.zeta))));
    REQUIRE_THAT(estimator.omega1_hat_rad_s(omega1), WithinAbs(x.omega1_hat, 2e-3));
  }
}

TEST_CASE("omega1_hat follows when the estimate is frozen or projected: (18) always holds") {
  control::AdaptiveOptions options;
  options.zeta0 = 10.0;
  options.theta_max_N = 20.0;
  control::ThetaEstimator estimator{options, wheels};
  CHECK(estimator.zeta_N() == 10.0);
  CHECK(estimator.omega1_hat_rad_s(100.0) == 100.0);
  const paper::Gains<double> gains{.gamma = options.gamma, .ka1 = options.ka1};
  for (const double phi : {0.8, -0.2, 0.8, 1.0}) {
    for (int n = 0; n < 100; ++n) {
      auto past = balanced(1e-3, 60.0, phi);
      past.zeta_rate_N_s = -3.0;
      estimator.update(past);
      const paper::AdaptiveState<double> x{.omega1_hat = estimator.omega1_hat_rad_s(100.0), .zeta = estimator.zeta_N()};
      REQUIRE_THAT(paper::laws(wheels).theta_hat(gains, x, 100.0), WithinAbs(estimator.theta_N(), 1e-9));
    }
  }
  CHECK(estimator.theta_N() == 20.0);
  CHECK_THAT(estimator.zeta_N(), WithinAbs(10.0 - 3.0 * 0.3, 1e-9));  // it stands while phi <= 0
  estimator.reset();
  CHECK(estimator.zeta_N() == 10.0);
  CHECK(estimator.omega1_hat_rad_s(100.0) == 100.0);
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
      // The wheel gains 5 rad/s per cycle and the error is large. The estimate must ignore both.
      estimator.update({.dt_s = 1e-3,
                        .omega1_before_rad_s = 100.0 + 5.0 * n,
                        .omega1_after_rad_s = 105.0 + 5.0 * n,
                        .brake_torque_Nm = 2.0,
                        .phi = phi,
                        .zeta_rate_N_s = 50.0});
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

TEST_CASE("A zero interval and a tiny slip cause no invalid numbers") {
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

TEST_CASE("A standing wheel leaves the estimate, whatever the brake holds") {
  const control::AdaptiveOptions options;
  control::ThetaEstimator estimator{options, rig::WheelParameters{}};
  for (int n = 0; n < 200; ++n) estimator.update(balanced(1e-3, 23.0, 0.8));
  const double before_N = estimator.theta_N();
  for (const auto& [from, to] : {std::pair{0.0, 0.0}, std::pair{5.0, 0.0}, std::pair{0.0, 5.0}}) {
    estimator.update({.dt_s = 1e-3,
                      .omega1_before_rad_s = from,
                      .omega1_after_rad_s = to,
                      .brake_torque_Nm = 9.0,
                      .phi = 0.9,
                      .zeta_rate_N_s = 50.0});
    CHECK(estimator.theta_N() == before_N);
    CHECK(estimator.zeta_N() == 0.0);
  }
}

TEST_CASE("An innovation gain that vanishes leaves zeta alone, and no NaN") {
  control::AdaptiveOptions options;
  options.gamma = options.ka1 = 1e-200;
  control::ThetaEstimator estimator{options, rig::WheelParameters{}};
  estimator.update(control::ForceInterval{.dt_s = 1e-3, .tyre_force_N = 20.0, .phi = 0.9, .zeta_rate_N_s = 50.0});
  CHECK_THAT(estimator.theta_N(), WithinAbs(0.05, 1e-12));
}

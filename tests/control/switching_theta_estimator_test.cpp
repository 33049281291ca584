// The switching estimate of theta, and its bounds.
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "catch.hpp"
#include "control/sliding_surface.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

TEST_CASE("The switching estimate integrates -gamma k phi s between its bounds and never leaves them") {
  const control::SwitchingAdaptationOptions<> options{
      .gamma = 40.0, .theta0_N = 20.0, .theta_min_N = 15.0, .theta_max_N = 30.0};
  control::SwitchingThetaEstimator theta{options};
  CHECK(theta.theta_N() == 20.0);
  theta.update(0.01, 1.2, -1.0);
  CHECK_THAT(theta.theta_N(), WithinAbs(20.0 + 40.0 * 1.2 * 0.01, 1e-12));
  theta.update(0.01, -1.2, -1.0);  // in traction phi < 0 and the law's sign turns round
  CHECK_THAT(theta.theta_N(), WithinAbs(20.0, 1e-12));

  std::mt19937 random{5};
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  bool at_min = false, at_max = false;
  for (int i = 0; i < 5000; ++i) {
    theta.update(0.05, 1.5, unit(random));
    CHECK((theta.theta_N() >= 15.0 && theta.theta_N() <= 30.0));
    at_min = at_min || theta.theta_N() == 15.0;
    at_max = at_max || theta.theta_N() == 30.0;
  }
  CHECK((at_min && at_max));

  // Projection does not wind up: from the bound the first step the other way already counts.
  for (int i = 0; i < 100; ++i) theta.update(0.05, 1.5, -1.0);
  theta.update(0.01, 1.0, 1.0);
  CHECK_THAT(theta.theta_N(), WithinAbs(30.0 - 0.4, 1e-12));
  theta.reset();
  CHECK(theta.theta_N() == 20.0);
}

TEST_CASE("Options of the switching estimate that are not usable are refused") {
  using Options = control::SwitchingAdaptationOptions<>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto made = [](const Options& o) { return control::SwitchingThetaEstimator{o}.theta_N(); };
  CHECK_NOTHROW(made(Options{.gamma = 0.0}));
  CHECK_THROWS_AS(made(Options{.gamma = -1.0}), std::invalid_argument);
  CHECK_THROWS_AS(made(Options{.gamma = nan}), std::invalid_argument);
  CHECK_THROWS_AS(made(Options{.theta0_N = nan}), std::invalid_argument);
  CHECK_THROWS_AS(made(Options{.theta0_N = 5.0, .theta_min_N = 10.0}), std::invalid_argument);
  CHECK_THROWS_AS(made(Options{.theta0_N = 50.0, .theta_max_N = 40.0}), std::invalid_argument);
}

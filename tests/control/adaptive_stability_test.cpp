// Theorem 3.1 in closed loop: the Lyapunov function of the sampled-data controller.

#include <algorithm>
#include <cmath>
#include <random>
#include <string_view>
#include <vector>

#include "catch.hpp"
#include "control/adaptive_controller.hpp"
#include "control/adaptive_gains.hpp"
#include "control/braking_bench.hpp"
#include "control/drawn_gains.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

struct LyapunovRun {
  std::vector<double> V, V_rate_expected, phi;
};

/// V of Theorem 3.1 and the -x'Qx - ka1 phi theta~^2 that its derivative should be, from the plant's true state.
LyapunovRun lyapunov_run(const bench::Setup& s) {
  const auto& o = s.options.adaptive;
  const double p12 = o.q11 / o.ks0, p22 = (o.q22 + p12) / o.ks1;  // PA + A'P = -2Q by hand
  const double p11 = o.ks1 * p12 + o.ks0 * p22;
  const auto run = bench::brake(s, "adaptive");
  LyapunovRun result;
  double I = 0.0, before = 0.0;
  for (const auto& tick : run.ticks) {
    const double e = bench::e_v(s.rig.wheels, tick.omega1, tick.omega2, s.options.slip_ref);
    if (tick.t > 0) I += (before + e) / 2 / s.options.rate_Hz;
    before = e;
    const double error = s.rig.tyre.theta_N - tick.output.theta_est_N;
    const double phi = std::sin(s.rig.tyre.C * std::atan(s.rig.tyre.B * tick.slip));
    result.V.push_back((p11 * I * I + 2 * p12 * I * e + p22 * e * e + error * error / o.gamma) / 2);
    result.V_rate_expected.push_back(-(o.q11 * I * I + o.q22 * e * e) - o.ka1 * phi * error * error);
    result.phi.push_back(phi);
  }
  return result;
}

}  // namespace

TEST_CASE("V never grows and its derivative is -x'Qx - ka1 phi theta~^2") {
  std::mt19937 random{2024};
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>{low, high}(random);
  };
  for (int i = 0; i < 12; ++i) {
    CAPTURE(i);
    bench::Setup s;
    s.plant_step_s = 1e-4;
    s.options.rate_Hz = 10000.0;
    s.options.slip_ref = between(0.08, 0.3);
    s.rig.tyre.theta_N = between(10.0, 60.0);
    s.rig.tyre.B = between(15.0, 35.0);
    s.rig.tyre.C = between(1.3, 1.8);
    bench::draw_gains(s.options.adaptive, between);
    s.options.adaptive.zeta0 = between(0.5, 1.4) * s.rig.tyre.theta_N;
    s.omega2_start = between(80.0, 180.0);
    s.omega1_start = s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m * (1.0 - between(0.02, 0.06));
    s.max_time_s = 0.5;
    const auto run = lyapunov_run(s);
    REQUIRE(run.V.size() > 4000);
    const double scale = *std::max_element(run.V.begin(), run.V.end());
    double steepest = 0.0;
    for (const double rate : run.V_rate_expected) steepest = std::max(steepest, std::abs(rate));
    for (std::size_t n = 1; n + 1 < run.V.size(); ++n) {
      REQUIRE(run.phi[n] > 0.0);
      REQUIRE(run.V[n + 1] <= run.V[n] + 1e-7 * scale);
      const double rate = (run.V[n + 1] - run.V[n - 1]) / 2 * s.options.rate_Hz;
      REQUIRE_THAT(rate, WithinAbs(run.V_rate_expected[n], 0.005 * steepest));
    }
  }
}

TEST_CASE("the adaptive controller reports the states of (17), and V and V' of Theorem 3.1") {
  // Independent of the controller: I by the trapezoidal rule, V by the closed form of P, V' by differences of V.
  bench::Setup s;
  s.plant_step_s = 1e-4;
  s.options.rate_Hz = 10000.0;
  s.options.adaptive.zeta0 = 15.0;
  s.omega1_start = 0.95 * s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m;
  s.max_time_s = 0.5;
  const control::LawController<control::AdaptiveLaw> controller({s.options, s.rig});
  std::vector<std::string_view> names;
  for (const rig::Signal& signal : controller.signals()) names.push_back(signal.name);
  CHECK(names == std::vector<std::string_view>{"I_m", "omega1_hat_rad_s", "zeta_N", "V", "V_dot"});

  const auto expected = lyapunov_run(s);
  const auto run = bench::brake(s, "adaptive");
  const auto& o = s.options.adaptive;
  const double scale = *std::max_element(expected.V.begin(), expected.V.end());
  double steepest = 0.0;
  for (const double rate : expected.V_rate_expected) steepest = std::max(steepest, std::abs(rate));
  double I = 0.0;
  for (std::size_t n = 1; n < run.ticks.size(); ++n) {
    const auto& tick = run.ticks[n];
    const rig::SignalValues& signals = tick.output.signals;
    I +=
        (run.ticks[n - 1].output.slip_velocity_error_m_s + tick.output.slip_velocity_error_m_s) / 2 / s.options.rate_Hz;
    REQUIRE_THAT(signals[0], WithinAbs(I, 1e-9));
    // (18) holds among the reported states.
    const double theta_hat_N =
        signals[2] + o.gamma * o.ka1 * s.rig.wheels.J1_kg_m2 / s.rig.wheels.r1_m * (tick.omega1 - signals[1]);
    REQUIRE_THAT(theta_hat_N, WithinAbs(tick.output.theta_est_N, 1e-9));
    REQUIRE_THAT(signals[3], WithinAbs(expected.V[n], 1e-9 * scale));
    REQUIRE_THAT(signals[4], WithinAbs(expected.V_rate_expected[n], 0.005 * steepest));
  }
}

// Sliding mode: the law as written, and its reaching time.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <string_view>

#include "catch.hpp"
#include "control/baseline_bench.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// Sliding mode with the ideal actuator, which cannot push the wheel: the torque must never be asked to be below 0.
bench::Setup setup(double K, double gamma, double theta0, double rate_Hz = 1000.0) {
  bench::Setup s;
  s.options.rate_Hz = rate_Hz;
  s.options.sliding_mode = {.gain_m_s2 = K, .adaptation = {.gamma = gamma, .theta0_N = theta0}};
  s.options.sliding_mode_smooth.adaptation = s.options.sliding_mode.adaptation;
  s.options.sliding_mode_smooth.gain_m_s2 = K;
  return s;
}

double first_time_at_surface(const bench::Result& run) {
  const double sign0 = std::copysign(1.0, run.ticks.front().output.slip_velocity_error_m_s);
  for (const auto& tick : run.ticks) {
    if (tick.output.slip_velocity_error_m_s * sign0 <= 0.0) return tick.t;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

TEST_CASE("For vanishing periods the sliding-mode torque is the law as written") {
  std::mt19937 random{3};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  for (int i = 0; i < 50; ++i) {
    auto s = setup(2 + 20 * unit(random), 0.0, 10 + 40 * unit(random), 1e7);
    s.options.sliding_mode.reaching_per_s = i % 2 == 0 ? 0.0 : 40 * unit(random);
    const auto controller = control::make_controller("sliding-mode", {s.options, s.rig});
    const double error = 4 * unit(random) - 3;
    const auto in = baseline::input_at(s.rig, 40 + 130 * unit(random), error, 0.0);
    controller->reset(in);
    const auto out = controller->step(in);
    const double sign = error > 0 ? 1.0 : -1.0;
    const double written =
        s.rig.wheels.J1_kg_m2 / s.rig.wheels.r1_m *
        (baseline::gain(s.rig, 0.15) * s.options.sliding_mode.adaptation.theta0_N * baseline::phi(s.rig, in.slip) +
         baseline::drift(s.rig, in.speeds, 0.15) - s.options.sliding_mode.gain_m_s2 * sign -
         s.options.sliding_mode.reaching_per_s * error);
    CHECK_THAT(out.brake_torque_Nm, WithinAbs(written, 1e-4));
    CHECK_THAT(out.slip_velocity_error_m_s, WithinAbs(error, 1e-12));
    CHECK(out.theta_est_N == s.options.sliding_mode.adaptation.theta0_N);
  }
}

TEST_CASE("Sliding mode reaches e_v = 0 within |e_v(0)|/eta when K exceeds the mismatch by eta, and stays near it") {
  // Without adaptation the mismatch is k phi |theta - theta0| <= k |theta - theta0|.
  const double mismatch = GENERATE(-4.0, -1.5, 0.0, 1.5, 4.0);
  const double rate_Hz = GENERATE(100.0, 1000.0, 10'000.0);
  const double K = 12.0;
  auto s = setup(K, 0.0, 23.0 - mismatch, rate_Hz);
  const double bound = baseline::gain(s.rig, 0.15) * std::abs(mismatch);
  const double eta = K - bound;
  REQUIRE(eta > 0.0);
  const auto run = bench::brake(s, "sliding-mode");
  const double error0 = std::abs(run.ticks.front().output.slip_velocity_error_m_s);
  CAPTURE(mismatch, rate_Hz);
  const double reached = first_time_at_surface(run);
  CHECK(reached <= error0 / eta + 1.0 / rate_Hz);
  CHECK(reached >= error0 / (K + bound) - 1.0 / rate_Hz);  // nor can it be faster than K and the mismatch together
  // From then on e_v can move away for one period only, at K + mismatch at most; discretising phi costs the rest.
  const double band = (K + bound) / rate_Hz;
  for (const auto& tick : run.ticks) {
    if (tick.t <= reached || 0.0990 * tick.omega2 <= 3.0) continue;
    REQUIRE(std::abs(tick.output.slip_velocity_error_m_s) <= 1.5 * band);
    REQUIRE(tick.slip < 0.5);  // no wheel lock
  }
}

TEST_CASE("With a reaching term the surface is reached after ln(1 + q |e_v(0)| / K) / q") {
  const double q = GENERATE(5.0, 32.0);
  const double K = 12.0, rate_Hz = 10'000.0;
  auto s = setup(K, 0.0, 23.0, rate_Hz);  // the exact theta
  s.options.sliding_mode.reaching_per_s = q;
  const auto run = bench::brake(s, "sliding-mode");
  const double error0 = std::abs(run.ticks.front().output.slip_velocity_error_m_s);
  CHECK_THAT(first_time_at_surface(run), WithinAbs(std::log1p(q * error0 / K) / q, 3.0 / rate_Hz));
}

TEST_CASE("With adaptation V = |e_v| + theta_tilde^2/(2 gamma) falls by eta or more until the surface is reached") {
  // K alone is not enough: |theta - theta0| k = 21 m/s^2. Outside the surface V' = -K, whatever theta0 (docs).
  const double theta0 = GENERATE(10.0, 36.0);
  const double K = 8.0, gamma = 60.0, h = 1e-4;
  auto s = setup(K, gamma, theta0, 1.0 / h);
  const auto run = bench::brake(s, "sliding-mode");
  const auto V = [&](const bench::Tick& tick) {
    return std::abs(tick.output.slip_velocity_error_m_s) + std::pow(23.0 - tick.output.theta_est_N, 2) / (2 * gamma);
  };
  const double reached = first_time_at_surface(run);
  REQUIRE(reached <= V(run.ticks.front()) / K + h);
  int checked = 0;
  for (std::size_t n = 50; n < run.ticks.size() && run.ticks[n].t < reached; n += 50) {
    if (run.ticks[n - 50].output.brake_torque_Nm < 0.0) continue;  // below what a brake can give
    const double rate = (V(run.ticks[n]) - V(run.ticks[n - 50])) / (50 * h);
    CHECK_THAT(rate, WithinRel(-K, 0.03));
    ++checked;
  }
  CHECK(checked > 10);
  // Once it slides, the mean sign is -k phi theta_tilde / K, so theta_tilde decays with the rate gamma (k phi)^2 / K.
  std::size_t sliding = 0;
  for (std::size_t n = 0; run.ticks[n].t < 1.0; ++n) {
    if (std::abs(run.ticks[n].output.slip_velocity_error_m_s) > 10 * K * h) sliding = n + 1;
  }
  REQUIRE(run.ticks[sliding].t < 0.9);
  const double k_phi = baseline::gain(s.rig, 0.15) * baseline::phi(s.rig, 0.15);
  const double rate = gamma * k_phi * k_phi / K;
  const auto later = sliding + static_cast<std::size_t>(std::lround(1.0 / (rate * h)));
  const double tilde1 = 23.0 - run.ticks[sliding].output.theta_est_N;
  CHECK_THAT((23.0 - run.ticks[later].output.theta_est_N) / tilde1, WithinAbs(std::exp(-1.0), 0.02));
}

TEST_CASE("theta_hat is held while the torque is outside the actuator's range and adaptation would drive it further") {
  auto s = setup(10.0, 100.0, 20.0);
  const auto controller = control::make_controller("sliding-mode", {s.options, s.rig});
  const auto after = [&](double error, double max_torque) {
    auto in = baseline::input_at(s.rig, 150.0, error, 0.0);
    in.max_brake_torque_Nm = max_torque;
    controller->reset(in);
    double theta = 0.0;
    for (int n = 0; n < 50; ++n) {
      const control::SlipOutput output = controller->step(in);
      theta = output.theta_est_N;
      in.dt_s = 1e-3;
      bench::note_sent(in, output.brake_torque_Nm);
    }
    return theta;
  };
  CHECK(after(-0.5, 1.0) == 20.0);  // asks for more than the 1 N m there is
  CHECK(after(-0.5, 9.0) > 21.0);
  CHECK(after(0.5, 1.0) < 19.0);  // asks for less: adaptation goes on
}

TEST_CASE("The boundary layer's motion solves e' = -K sat(e/width) exactly") {
  const double K = 20.0;
  for (const double width : {0.02, 0.5, 3.0}) {
    for (const double error0 : {-2.5, -0.4, -0.01, 0.0, 0.3, 1.7}) {
      // Independent: the torque at a vanishing model is J1/r1 times the mean rate over the period, by fine Euler here.
      const int n = 200'000;
      const double h = 0.01;
      double e = error0;
      for (int i = 0; i < n; ++i) e -= h / n * K * std::clamp(e / width, -1.0, 1.0);
      bench::Setup s = setup(K, 0.0, 0.0, 1.0 / h);
      s.options.sliding_mode_smooth.boundary_m_s = width;
      auto& w = s.rig.wheels;
      w.d1_Nms_rad = w.d2_Nms_rad = w.M10_Nm = w.M20_Nm = 0.0;
      const auto controller = control::make_controller("sliding-mode-smooth", {s.options, s.rig});
      const auto in = baseline::input_at(s.rig, 170.0, error0, 0.0);
      controller->reset(in);
      const double rate = controller->step(in).brake_torque_Nm * w.r1_m / w.J1_kg_m2;
      CAPTURE(width, error0);
      CHECK_THAT(rate, WithinAbs((e - error0) / h, 0.02));
    }
  }
}

TEST_CASE("The boundary layer ends the chatter at every rate, however thin it is, where the sign chatters on") {
  const double rate_Hz = GENERATE(100.0, 1000.0, 10'000.0);
  const auto variation_late = [&](const bench::Result& run) {
    double sum = 0.0;
    for (std::size_t n = 1; n < run.ticks.size(); ++n) {
      const auto& tick = run.ticks[n];
      if (tick.t > 1.0 && 0.0990 * tick.omega2 > 3.0) sum += std::abs(tick.applied_Nm - run.ticks[n - 1].applied_Nm);
    }
    return sum;
  };
  auto s = setup(12.0, 20.0, 20.0, rate_Hz);
  const double chatter = variation_late(bench::brake(s, "sliding-mode"));
  for (const double width : {1e-3, 0.05, 0.5}) {
    s.options.sliding_mode_smooth.boundary_m_s = width;
    const auto run = bench::brake(s, "sliding-mode-smooth");
    CAPTURE(rate_Hz, width);
    CHECK(variation_late(run) < 0.1 * chatter);
    for (const auto& tick : run.ticks) {
      if (0.0990 * tick.omega2 > 3.0) REQUIRE(tick.slip < 0.5);
    }
    // Inside the layer e_v settles where K e_v/width makes up for the mismatch; adaptation takes that to 0.
    const auto& late = run.ticks[static_cast<std::size_t>(1.5 * rate_Hz)];
    CHECK_THAT(late.output.slip_velocity_error_m_s, WithinAbs(0.0, 0.05));
  }
}

TEST_CASE("Gains of the sliding-mode laws that are not usable are refused") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](std::string_view name, auto&& spoil) {
    control::ControlOptions options;
    const rig::RigParameters rig;
    CHECK_NOTHROW(control::make_controller(name, {options, rig}));
    spoil(options);
    CHECK_THROWS_AS(control::make_controller(name, {options, rig}), std::invalid_argument);
  };
  refused("sliding-mode", [](auto& o) { o.sliding_mode.gain_m_s2 = 0.0; });
  refused("sliding-mode", [](auto& o) { o.sliding_mode.adaptation.gamma = -1.0; });
  refused("sliding-mode-smooth", [](auto& o) { o.sliding_mode_smooth.boundary_m_s = 0.0; });
  refused("sliding-mode-smooth", [=](auto& o) { o.sliding_mode_smooth.gain_m_s2 = nan; });
  refused("super-twisting", [](auto& o) { o.super_twisting.k1 = 0.0; });
  refused("super-twisting", [=](auto& o) { o.super_twisting.k2 = nan; });
  for (const std::string_view name : {"sliding-mode", "sliding-mode-smooth", "super-twisting", "pi", "five-phase"}) {
    refused(name, [](auto& o) { o.rate_Hz = 0.0; });
  }
}

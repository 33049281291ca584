// Sliding mode stepped back through the brake's lag, on the bench's own plant.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "catch.hpp"
#include "control/baseline_bench.hpp"

using namespace abs_hil;

namespace {

bench::Setup setup() {
  bench::Setup s;
  s.options.sliding_mode_smooth = {.gain_m_s2 = 20.0, .boundary_m_s = 0.4};
  s.options.sliding_mode_smooth.adaptation = {.gamma = 30.0, .theta0_N = 18.0};
  auto& own = s.options.sliding_mode_actuator;
  own.gain_m_s2 = s.options.sliding_mode_smooth.gain_m_s2;
  own.boundary_m_s = s.options.sliding_mode_smooth.boundary_m_s;
  own.adaptation = s.options.sliding_mode_smooth.adaptation;
  return s;
}

/// A brake behind its lag, with limits that the law never meets, and exact speeds.
bench::Setup behind_the_lag() {
  bench::Setup s = setup();
  s.ideal_actuator = false;
  s.options.rate_Hz = 10'000.0;
  s.plant_step_s = 1e-4;
  s.rig.brake = {.b1_Nm = 2000.0, .b2_Nm = 0.0, .u0 = 0.0, .c31_per_s = 20.0};
  s.options.sliding_mode_actuator.observer = {.force_rate_N2_s = 1e9, .brake_rate_Nm2_s = 1e-9};
  s.options.sliding_mode_actuator.adaptation.gamma = 0.0;
  s.options.sliding_mode_actuator.adaptation.theta0_N = s.rig.tyre.theta_N;  // the model is exact
  s.omega2_start = 170.0;
  s.omega1_start = 170.0;
  s.max_time_s = 0.4;
  return s;
}

}  // namespace

TEST_CASE("With an ideal actuator the output is that of the law with a boundary layer, bit for bit") {
  const bench::Setup s = setup();
  const auto own = bench::brake(s, "sliding-mode-actuator");
  const auto smooth = bench::brake(s, "sliding-mode-smooth");
  REQUIRE(own.ticks.size() == smooth.ticks.size());
  for (std::size_t n = 0; n < own.ticks.size(); ++n) {
    REQUIRE(own.ticks[n].output.brake_torque_Nm == smooth.ticks[n].output.brake_torque_Nm);
  }
}

TEST_CASE("With an exact model the error that the lag leaves decays at its gain") {
  const bench::Setup s = behind_the_lag();
  const auto& w = s.rig.wheels;
  const auto& o = s.options.sliding_mode_actuator;
  const double k = baseline::gain(s.rig, s.options.slip_ref);
  double eta0 = 0.0;
  for (const auto& tick : bench::brake(s, "sliding-mode-actuator").ticks) {
    const double e = bench::e_v(w, tick.omega1, tick.omega2, s.options.slip_ref);
    const double alpha = -o.gain_m_s2 * std::clamp(e / o.boundary_m_s, -1.0, 1.0) +
                         k * s.rig.tyre.theta_N * baseline::phi(s.rig, tick.slip) +
                         baseline::drift(s.rig, {tick.omega1, tick.omega2}, s.options.slip_ref);
    const double eta = w.r1_m / w.J1_kg_m2 * tick.torque - alpha;
    if (tick.t == 0.0) eta0 = eta;
    CAPTURE(tick.t, eta, eta0);
    REQUIRE(std::abs(eta - eta0 * std::exp(-o.lag_gain_per_s * tick.t)) < 0.03 * std::abs(eta0));
  }
}

TEST_CASE("Behind the lag it holds the wanted slip where the plain boundary layer swings") {
  bench::Setup s = setup();
  s.ideal_actuator = false;
  s.encoders = true;
  s.rig.tyre.theta_N = 47.0;  // of paper-timing
  s.options.sliding_mode_actuator.adaptation.theta0_N = 40.0;
  s.options.sliding_mode_smooth.adaptation.theta0_N = 40.0;
  const auto own = bench::brake(s, "sliding-mode-actuator");
  const auto smooth = bench::brake(s, "sliding-mode-smooth");
  CAPTURE(own.slip_rms, smooth.slip_rms);
  CHECK(own.slip_rms < 0.5 * smooth.slip_rms);
  CHECK(std::isfinite(own.stop_time_s));
}

TEST_CASE("Options of the stepped-back sliding mode out of range are refused") {
  const auto made = [](auto change) {
    control::ControlOptions options;
    change(options.sliding_mode_actuator);
    return control::make_controller("sliding-mode-actuator", {options, {}});
  };
  CHECK_THROWS_AS(made([](auto& o) { o.gain_m_s2 = 0.0; }), std::invalid_argument);
  CHECK_THROWS_AS(made([](auto& o) { o.boundary_m_s = 0.0; }), std::invalid_argument);
  CHECK_THROWS_AS(made([](auto& o) { o.lag_gain_per_s = -1.0; }), std::invalid_argument);
  CHECK_THROWS_AS(made([](auto& o) { o.adaptation.gamma = -1.0; }), std::invalid_argument);
}

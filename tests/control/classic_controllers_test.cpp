// Relay and PI.

#include "control/classic_controllers.hpp"

#include <cmath>
#include <random>

#include "catch.hpp"
#include "control/baseline_bench.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("The relay switches exactly at its threshold, which is the slip reference by default") {
  control::ControlOptions options;
  const rig::RigParameters rig;
  for (const double own : {0.0, 0.1, 0.7}) {
    options.relay.threshold = own;
    const auto relay = control::make_controller("relay", {options, rig});
    control::SlipInput in{.speeds = {120.0, 150.0}, .slip_ref = 0.15, .max_brake_torque_Nm = 9.03};
    relay->reset(in);
    const double threshold = own > 0.0 ? own : 0.15;
    const auto torque_at = [&](double slip) {
      in.slip = slip;
      const auto out = relay->step(in);
      CHECK(std::isnan(out.theta_est_N));
      return out.brake_torque_Nm;
    };
    CHECK(torque_at(threshold) == 9.03);
    CHECK(torque_at(std::nextafter(threshold, 1.0)) == 0.0);
    CHECK(torque_at(std::nextafter(threshold, 0.0)) == 9.03);  // no hysteresis
    CHECK(torque_at(1.0) == 0.0);
    CHECK(torque_at(-0.3) == 9.03);
    in.max_brake_torque_Nm = std::numeric_limits<double>::infinity();
    CHECK_THAT(torque_at(0.0), WithinAbs(15.24 - 6.21, 1e-12));
  }
  options.relay.threshold = 1.0;
  CHECK_THROWS_AS(control::make_controller("relay", {options, rig}), std::invalid_argument);
}

TEST_CASE("The feed-forward torque keeps e_v constant on the plant on which it was measured") {
  std::mt19937 random{21};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  rig::RigParameters rig;
  const auto& w = rig.wheels;
  for (int i = 0; i < 100; ++i) {
    const double slip_ref = 0.05 + 0.3 * unit(random), theta = 10 + 60 * unit(random);
    auto in = baseline::input_at(rig, 30 + 140 * unit(random), 2 * unit(random) - 1.5, 0.0, slip_ref);
    const double force = theta * baseline::phi(rig, std::abs(in.slip));
    in.alpha2_rad_s2 = (-w.r2_m * force - w.d2_Nms_rad * in.speeds.omega2_rad_s - w.M20_Nm) / w.J2_kg_m2;
    const double torque = control::measured_equivalent_torque_Nm(control::paper::laws(w), in);
    const double alpha1 = (w.r1_m * force - w.d1_Nms_rad * in.speeds.omega1_rad_s - w.M10_Nm - torque) / w.J1_kg_m2;
    CHECK_THAT((1 - slip_ref) * w.r2_m * in.alpha2_rad_s2 - w.r1_m * alpha1, WithinAbs(0.0, 1e-11));
    // A lower wheel that decelerates less than by friction gives no negative tyre force.
    in.alpha2_rad_s2 = 50.0;
    CHECK_THAT(control::measured_equivalent_torque_Nm(control::paper::laws(w), in),
               WithinAbs(w.J1_kg_m2 / w.r1_m * baseline::drift(rig, in.speeds, slip_ref), 1e-12));
  }
}

TEST_CASE("PI is the discrete formula, on slip with gains that follow the car's speed") {
  const double rate_Hz = GENERATE(100.0, 1000.0, 10'000.0);
  control::ControlOptions options;
  options.rate_Hz = rate_Hz;
  options.pi = {.kp_per_s = 25.0, .ki_per_s2 = 40.0, .feed_forward = 0.6};
  const rig::RigParameters rig;
  const auto& w = rig.wheels;
  const auto pi = control::make_controller("pi", {options, rig});
  const double h = 1.0 / rate_Hz;
  const double kp = (1 - std::exp(-25.0 * h)) / h;
  double sum = 0.0, before = 0.0;
  for (int n = 0; n < 200; ++n) {
    const double omega2 = 160.0 - 20.0 * n * h, error = -0.6 + 0.5 * std::sin(3.0 * n);
    auto in = baseline::input_at(rig, omega2, error, n == 0 ? 0.0 : h);
    in.alpha2_rad_s2 = -80.0;
    if (n == 0) pi->reset(in);
    const double v = w.r2_m * omega2;
    const double slip_error = in.slip - 0.15;
    if (n > 0) sum += 0.5 * h * (before + v * slip_error);
    before = v * slip_error;
    const double wanted = 0.6 * control::measured_equivalent_torque_Nm(control::paper::laws(w), in) -
                          w.J1_kg_m2 / w.r1_m * (kp * v * slip_error + 40.0 * sum);
    CHECK_THAT(pi->step(in).brake_torque_Nm, WithinRel(wanted, 1e-9) || WithinAbs(wanted, 1e-9));
  }
}

TEST_CASE("PI does not wind up while the actuator is at its limit") {
  control::ControlOptions options;
  options.pi = {.kp_per_s = 20.0, .ki_per_s2 = 200.0, .feed_forward = 0.0};
  const rig::RigParameters rig;
  const auto pi = control::make_controller("pi", {options, rig});
  auto in = baseline::input_at(rig, 150.0, -2.0, 0.0);
  in.max_brake_torque_Nm = 1.5;
  pi->reset(in);
  REQUIRE(pi->step(in).brake_torque_Nm > 1.5);
  in.dt_s = 1e-3;
  // 2 s at the limit: an integral would have grown to -4 m
  for (int n = 0; n < 2000; ++n) bench::note_sent(in, pi->step(in).brake_torque_Nm);
  in = baseline::input_at(rig, 150.0, 0.0, 1e-3);
  in.max_brake_torque_Nm = 1.5;
  // The rest is the trapezoid of the two cycles around the limit, not 2 s of error.
  CHECK(std::abs(pi->step(in).brake_torque_Nm) < 0.1);
}

TEST_CASE("PI settles at the wanted slip with encoders and the real actuator, and options out of range are refused") {
  bench::Setup s;
  s.ideal_actuator = false;
  s.encoders = true;
  const auto run = bench::brake(s, "pi");
  CHECK(run.slip_rms < 0.03);
  CHECK(run.stop_time_s < 2.5);

  const auto refused = [&](control::PiOptions pi) {
    auto options = s.options;
    options.pi = pi;
    CHECK_THROWS_AS(control::make_controller("pi", {options, s.rig}), std::invalid_argument);
  };
  refused({.kp_per_s = 0.0});
  refused({.ki_per_s2 = -1.0});
  refused({.feed_forward = 1.1});
  refused({.feed_forward = std::numeric_limits<double>::quiet_NaN()});
}

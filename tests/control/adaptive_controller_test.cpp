// The paper's controller with Table 1's gains, on the bench's own plant: its stops and its slip.
#include "control/adaptive_controller.hpp"

#include <algorithm>
#include <cmath>

#include "catch.hpp"
#include "control/braking_bench.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

double first_within_2_percent_s(const bench::Result& run, double theta) {
  for (const auto& tick : run.ticks) {
    if (std::abs(tick.output.theta_est_N - theta) <= 0.02 * theta) return tick.t;
  }
  return rig::unknown;
}

bench::Setup real_rig(double rate_Hz = 1000.0) {
  bench::Setup s;
  s.ideal_actuator = false;
  s.encoders = true;
  s.options.rate_Hz = rate_Hz;
  return s;
}

}  // namespace

TEST_CASE("Table 1 with an ideal actuator and true speeds: stop, distance and time to know theta") {
  for (const double rate_Hz : {100.0, 500.0, 1000.0, 2000.0, 10000.0}) {
    CAPTURE(rate_Hz);
    bench::Setup s;
    s.options.rate_Hz = rate_Hz;
    const auto run = bench::brake(s, "adaptive");
    CHECK_THAT(run.stop_time_s, WithinRel(2.283, 0.005));
    CHECK_THAT(run.stop_distance_m, WithinRel(19.32, 0.005));
    CHECK_THAT(first_within_2_percent_s(run, 23.0), WithinAbs(0.22, 0.03));
  }
}

TEST_CASE("theta = 45 with an ideal actuator stops in the time that the paper's plots show") {
  bench::Setup s;
  s.rig.tyre.theta_N = 45.0;
  const auto run = bench::brake(s, "adaptive");
  CHECK_THAT(run.stop_time_s, WithinRel(1.208, 0.005));
  CHECK_THAT(run.stop_distance_m, WithinRel(10.08, 0.005));
}

TEST_CASE("Table 1 with the real actuator and true speeds") {
  bench::Setup s;
  s.ideal_actuator = false;
  const auto run = bench::brake(s, "adaptive");
  CHECK_THAT(run.stop_time_s, WithinRel(2.324, 0.005));
  CHECK_THAT(run.stop_distance_m, WithinRel(19.75, 0.005));
}

TEST_CASE("Table 1 with the real actuator and encoders: stop, distance, slip and theta, at any rate") {
  for (const double rate_Hz : {500.0, 1000.0, 2000.0, 5000.0, 10000.0}) {
    CAPTURE(rate_Hz);
    const auto run = bench::brake(real_rig(rate_Hz), "adaptive");
    CHECK_THAT(run.stop_time_s, WithinRel(2.325, 0.01));
    CHECK_THAT(run.stop_distance_m, WithinRel(19.73, 0.005));
    CHECK(run.slip_rms < 0.010);
    for (const auto& tick : run.ticks) {
      if (tick.t < 0.4 || 0.0990 * tick.omega2 < 3.0) continue;
      REQUIRE_THAT(tick.output.theta_est_N, WithinRel(23.0, 0.05));
    }
  }
}

TEST_CASE("Braking is sane for other tyres, speeds, references and rates") {
  for (const double theta : {10.0, 15.0, 30.0, 45.0, 60.0}) {
    for (const double rate_Hz : {100.0, 1000.0}) {
      CAPTURE(theta, rate_Hz);
      auto s = real_rig(rate_Hz);
      s.rig.tyre.theta_N = theta;
      const auto run = bench::brake(s, "adaptive");
      const auto locked = bench::brake(s, "locked");
      // Stopping distance goes with 1/theta (less the bearings' share), and is below that of the locked wheel.
      CHECK(run.stop_distance_m < 0.9 * locked.stop_distance_m);
      CHECK(run.stop_distance_m * theta > 0.85 * 19.72 * 23.0);
      CHECK(run.stop_distance_m * theta < 1.15 * 19.72 * 23.0);
    }
  }
  for (const double start : {60.0, 100.0, 180.0}) {
    for (const double slip_ref : {0.05, 0.1, 0.2, 0.3}) {
      CAPTURE(start, slip_ref);
      auto s = real_rig();
      s.omega1_start = s.omega2_start = start;
      s.options.slip_ref = slip_ref;
      const auto run = bench::brake(s, "adaptive");
      CHECK(run.stop_time_s < 3.0 * start / 180.0 + 0.3);
      if (start >= 100.0) CHECK(run.slip_rms < 0.04);
    }
  }
}

TEST_CASE("Without ABS the wheel locks and the way is a third longer") {
  auto s = real_rig();
  const auto run = bench::brake(s, "locked");
  CHECK_THAT(run.stop_time_s, WithinRel(3.19, 0.01));
  CHECK_THAT(run.stop_distance_m, WithinRel(26.9, 0.01));
}

TEST_CASE("The estimate finds a lower friction in mid-braking") {
  auto s = real_rig();
  s.theta_at = [](double t) { return t < 0.8 ? 30.0 : 18.0; };
  const auto run = bench::brake(s, "adaptive");
  CHECK_THAT(run.ticks[790].output.theta_est_N, WithinRel(30.0, 0.05));
  CHECK_THAT(run.ticks[1300].output.theta_est_N, WithinRel(18.0, 0.05));
}

TEST_CASE("For a changing theta the error stays in a ball that grows with its rate (Theorem 3.2)") {
  const auto ball_N = [](double rate_N_s) {
    bench::Setup s;
    s.theta_at = [=](double t) { return 23.0 + rate_N_s * t; };
    const auto run = bench::brake(s, "adaptive");
    double worst = 0.0;
    for (const auto& tick : run.ticks) {
      if (tick.t > 0.6 && tick.t < 1.5) {
        worst = std::max(worst, std::abs(23.0 + rate_N_s * tick.t - tick.output.theta_est_N));
      }
    }
    return worst;
  };
  const double one = ball_N(2.0), two = ball_N(4.0), four = ball_N(8.0);
  CHECK_THAT(two / one, WithinAbs(2.0, 0.1));
  CHECK_THAT(four / one, WithinAbs(4.0, 0.2));
  CHECK_THAT(one, WithinRel(2.0 / (21.0 * 0.78), 0.1));  // rate / (gamma ka1 phi)
}

TEST_CASE("Resetting starts the estimate and the integral afresh") {
  const bench::Setup s;
  const auto controller = control::make_controller("adaptive", {s.options, s.rig});
  const auto first = bench::brake(s, *controller);
  const auto second = bench::brake(s, *controller);
  REQUIRE(first.ticks.size() == second.ticks.size());
  for (std::size_t n = 0; n < first.ticks.size(); ++n) {
    REQUIRE(first.ticks[n].output.brake_torque_Nm == second.ticks[n].output.brake_torque_Nm);
  }
  CHECK(first.ticks.front().output.theta_est_N == 0.0);
}

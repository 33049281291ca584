// The five phases of the classic ABS, on a wheel whose acceleration is prescribed.
#include <stdexcept>
#include <vector>

#include "catch.hpp"
#include "control/baseline_bench.hpp"
#include "control/classic_controllers.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using control::BrakePhase;

namespace {

control::ControlOptions options_of_test(double rate_Hz = 1000.0) {
  control::ControlOptions options;
  options.rate_Hz = rate_Hz;
  options.five_phase = {.hold_below_m_s2 = -20.0,
                        .release_below_m_s2 = -40.0,
                        .recover_above_m_s2 = 5.0,
                        .reapply_below_m_s2 = 10.0,
                        .hold_limit_s = 0.05,
                        .recover_limit_s = 0.1,
                        .apply_Nm_s = 60.0,
                        .release_Nm_s = 100.0,
                        .reapply_Nm_s = 10.0};
  return options;
}

control::SlipInput input_at(const rig::RigParameters& rig, double acceleration, double dt) {
  control::SlipInput in{.dt_s = dt, .speeds = {120.0, 150.0}, .slip = 0.2, .slip_ref = 0.15};
  in.max_brake_torque_Nm = 9.03;
  in.alpha1_rad_s2 = acceleration / rig.wheels.r1_m;
  return in;
}

/// A wheel that dips into instability and comes back: its acceleration over time, piecewise linear, m/s^2.
double dip(double t) {
  const std::vector<std::pair<double, double>> trace{{0.0, 0.0},    {0.05, -10.0}, {0.07, -60.0}, {0.12, -60.0},
                                                     {0.16, 40.0},  {0.20, 40.0},  {0.24, -9.0},  {0.60, -9.0},
                                                     {0.62, -30.0}, {0.66, -30.0}, {0.68, -50.0}, {1.0, -50.0}};
  for (std::size_t i = 1; i < trace.size(); ++i) {
    const auto& [t0, a0] = trace[i - 1];
    const auto& [t1, a1] = trace[i];
    if (t <= t1) return a0 + (a1 - a0) * (t - t0) / (t1 - t0);
  }
  return trace.back().second;
}

struct Change {
  double t;
  BrakePhase phase;
};

std::vector<Change> walk(control::LawController<control::FivePhaseLaw>& c, const rig::RigParameters& rig, double h,
                         double end_s) {
  std::vector<Change> changes;
  auto in = input_at(rig, dip(0.0), 0.0);
  c.reset(in);
  BrakePhase before = c.law().phase();
  for (int n = 0; n * h < end_s; ++n) {
    in = input_at(rig, dip(n * h), n > 0 ? h : 0.0);
    (void)c.step(in);
    if (c.law().phase() != before) changes.push_back({n * h, c.law().phase()});
    before = c.law().phase();
  }
  return changes;
}

}  // namespace

TEST_CASE("On a wheel that dips and comes back the five phases follow each other at the thresholds, at every rate") {
  const double rate_Hz = GENERATE(100.0, 1000.0, 10'000.0);
  const auto options = options_of_test(rate_Hz);
  const rig::RigParameters rig;
  control::LawController<control::FivePhaseLaw> c{{options, rig}};
  const double h = 1.0 / rate_Hz;
  const auto changes = walk(c, rig, h, 0.7);
  // Where the trace crosses: -20 at 0.054, -40 at 0.062, +5 at 0.146, below +10 after its peak at 0.2245, -20 at
  // 0.6095, -40 at 0.67; the second hold ends by -40 there or, before, by its limit of 0.05 s, at 0.66.
  REQUIRE(changes.size() >= 5);
  const std::vector<Change> expected{{0.054, BrakePhase::hold},
                                     {0.062, BrakePhase::release},
                                     {0.146, BrakePhase::recover},
                                     {0.20 + 0.04 * 30.0 / 49.0, BrakePhase::reapply},
                                     {0.60 + 0.02 * 11.0 / 21.0, BrakePhase::hold}};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    CAPTURE(rate_Hz, i);
    CHECK(changes[i].phase == expected[i].phase);
    CHECK(changes[i].t >= expected[i].t - 1e-9);
    CHECK(changes[i].t <= expected[i].t + h + 1e-9);
  }
}

TEST_CASE("The torque follows the ramps of the phases, in N m/s, within what the actuator can give") {
  const auto options = options_of_test();
  const rig::RigParameters rig;
  control::LawController<control::FivePhaseLaw> c{{options, rig}};
  const double h = 1e-3;
  auto in = input_at(rig, -5.0, 0.0);
  c.reset(in);
  double torque = 0.0;
  const auto hold_for = [&](double acceleration, int cycles) {
    for (int n = 0; n < cycles; ++n) {
      torque = c.step(in = input_at(rig, acceleration, h)).brake_torque_Nm;
    }
  };
  torque = c.step(in).brake_torque_Nm;
  CHECK_THAT(torque, WithinAbs(60.0 * h, 1e-12));  // first cycle: one period's worth
  hold_for(-5.0, 49);
  CHECK_THAT(torque, WithinAbs(3.0, 1e-12));
  hold_for(-25.0, 20);
  CHECK(c.law().phase() == BrakePhase::hold);
  CHECK_THAT(torque, WithinAbs(3.0, 1e-12));
  hold_for(-50.0, 10);
  CHECK(c.law().phase() == BrakePhase::release);
  CHECK_THAT(torque, WithinAbs(2.0, 1e-12));
  hold_for(20.0, 10);
  CHECK(c.law().phase() == BrakePhase::recover);
  CHECK_THAT(torque, WithinAbs(2.0, 1e-12));
  hold_for(-5.0, 10);
  CHECK(c.law().phase() == BrakePhase::reapply);
  CHECK_THAT(torque, WithinAbs(2.1, 1e-12));
  hold_for(-5.0, 5000);
  CHECK(torque == 9.03);
  hold_for(-50.0, 500);
  CHECK(torque == 0.0);
}

TEST_CASE("Every phase ends") {
  const auto options = options_of_test();
  const rig::RigParameters rig;
  control::LawController<control::FivePhaseLaw> c{{options, rig}};
  auto in = input_at(rig, -25.0, 0.0);
  c.reset(in);
  const auto cycles_in = [&](BrakePhase phase, double acceleration) {
    int n = 0;
    do {
      (void)c.step(in = input_at(rig, acceleration, 1e-3));
      ++n;
    } while (c.law().phase() == phase && n < 10'000);
    return n;
  };
  (void)c.step(in);
  REQUIRE(c.law().phase() == BrakePhase::hold);
  CHECK(std::abs(cycles_in(BrakePhase::hold, -25.0) - 50) <= 1);  // hold_limit_s
  REQUIRE(c.law().phase() == BrakePhase::reapply);
  (void)c.step(in = input_at(rig, -50.0, 1e-3));
  (void)c.step(in);
  REQUIRE(c.law().phase() == BrakePhase::release);
  // The torque is 0 and the wheel does not accelerate: after recover_limit_s it counts as free.
  CHECK(cycles_in(BrakePhase::release, -1.0) <= 102);
  REQUIRE(c.law().phase() == BrakePhase::recover);
  CHECK(std::abs(cycles_in(BrakePhase::recover, -1.0) - 100) <= 1);
  CHECK(c.law().phase() == BrakePhase::reapply);
}

TEST_CASE("Five-phase does not use the slip or the car's speed") {
  const auto options = options_of_test();
  const rig::RigParameters rig;
  control::LawController<control::FivePhaseLaw> one{{options, rig}}, other{{options, rig}};
  for (int n = 0; n < 1000; ++n) {
    auto a = input_at(rig, dip(n * 1e-3), n > 0 ? 1e-3 : 0.0);
    auto b = a;
    b.slip = n % 2 == 0 ? -3.0 : 0.9;
    b.slip_ref = 0.4;
    b.speeds.omega2_rad_s = 20.0 + n;
    b.alpha2_rad_s2 = 7.0 * n;
    b.brake_torque_Nm = 4.0;
    b.mean_brake_torque_Nm = 3.0;
    if (n == 0) {
      one.reset(a);
      other.reset(b);
    }
    REQUIRE(one.step(a).brake_torque_Nm == other.step(b).brake_torque_Nm);
    REQUIRE(one.law().phase() == other.law().phase());
  }
}

TEST_CASE("A wheel that stands is released, though it does not decelerate") {
  const auto options = options_of_test();
  const rig::RigParameters rig;
  control::LawController<control::FivePhaseLaw> c{{options, rig}};
  auto in = input_at(rig, 0.0, 0.0);
  c.reset(in);
  for (int n = 0; n < 30; ++n) (void)c.step(in = input_at(rig, -2.0, 1e-3));
  REQUIRE(c.law().phase() == BrakePhase::apply);
  in.speeds.omega1_rad_s = 0.0;
  in.alpha1_rad_s2 = 0.0;
  (void)c.step(in);
  (void)c.step(in);
  CHECK(c.law().phase() == BrakePhase::release);
}

TEST_CASE("Five-phase options out of order are refused") {
  const rig::RigParameters rig;
  const auto refused = [&](auto&& spoil) {
    auto options = options_of_test();
    spoil(options.five_phase);
    CHECK_THROWS_AS(control::make_controller("five-phase", {options, rig}), std::invalid_argument);
  };
  refused([](auto& o) { o.release_below_m_s2 = -10.0; });
  refused([](auto& o) { o.hold_below_m_s2 = 0.0; });
  refused([](auto& o) { o.recover_above_m_s2 = -45.0; });
  refused([](auto& o) { o.reapply_below_m_s2 = -30.0; });
  refused([](auto& o) { o.apply_Nm_s = 0.0; });
  refused([](auto& o) { o.release_Nm_s = -1.0; });
  refused([](auto& o) { o.reapply_Nm_s = std::numeric_limits<double>::quiet_NaN(); });
  refused([](auto& o) { o.hold_limit_s = 0.0; });
  refused([](auto& o) { o.recover_limit_s = 0.0; });
}

// Gains and slip reference change during braking: the torque has no bump and the controller keeps its state.
#include <cmath>
#include <functional>

#include "catch.hpp"
#include "experiment/simulated_run.hpp"

namespace abs_hil::experiment {
namespace {

constexpr std::int64_t ms = 1'000'000;

/// A run in virtual time, cycle by cycle, with a change at one cycle.
struct Bench {
  test::Setup setup;
  driver::SimDriver driver{setup.plant, {.seed = 1, .start_speed_rad_s = setup.experiment.start_speed_rad_s}};
  RunLogic logic{test::logic_parts(setup)};
  runtime::CommandGate gate{setup.gate};
  std::int64_t now_ns{0};

  explicit Bench(const std::string& controller) : setup(test::braking(controller)) {
    driver.configure();
    driver.activate(0);
  }
  rig::CycleRecord step() {
    rig::Measurement measurement;
    rig::CycleRecord record;
    REQUIRE(driver.read(now_ns, measurement).ok());
    const rig::Command wanted = logic.step(measurement, gate, record);
    record.command = gate.check(wanted, {record.control.speeds_est, record.phase, now_ns}).command;
    REQUIRE(driver.write(record.command).ok());
    logic.commanded(record.command);
    now_ns += ms;
    return record;
  }
  rig::CycleRecord run(int cycles) {
    rig::CycleRecord record;
    for (int i = 0; i < cycles; ++i) record = step();
    return record;
  }
  /// The same law with its own gains.
  Adjustment retuned(const std::function<void(control::ControlOptions&)>& change) {
    control::ControlOptions options = setup.control;
    change(options);
    Adjustment adjustment{.kind = Adjustment::Kind::controller};
    adjustment.controller = control::make_controller(options.controller, {options, setup.plant.rig});
    return adjustment;
  }
};

void double_gains(control::ControlOptions& o) {
  for (control::AdaptiveOptions* law : {&o.adaptive, &o.adaptive_actuator.law}) {
    law->ks0 *= 2.0;
    law->ks1 *= 2.0;
    law->gamma *= 2.0;
  }
  o.pi.kp_per_s *= 2.0;
  o.pi.ki_per_s2 *= 2.0;
  o.sliding_mode_smooth.gain_m_s2 = 150.0;
  o.super_twisting.k1 *= 2.0;
}

TEST_CASE("changed gains: torque reference and theta continue without a jump, then the new gains act") {
  for (const char* controller :
       {"adaptive", "adaptive-actuator", "nominal", "pi", "sliding-mode-smooth", "super-twisting"}) {
    INFO(controller);
    Bench changed(controller), unchanged(controller);
    // 40 ms into braking e_v is large: a change of gains would show at once.
    const double theta_N = changed.run(40).control.theta_est_N;
    unchanged.run(40);
    REQUIRE(changed.logic.adjustments().put(changed.retuned(double_gains)) == 1);
    const rig::CycleRecord now = changed.step();
    const rig::CycleRecord as_before = unchanged.step();
    CHECK(now.reason == rig::Reason::gain_changed);
    CHECK(now.reason_value == 1.0);
    // The torque of this cycle is that of the old gains, and theta continues from its value: one interval at twice the
    // gain moves it twice as far.
    CHECK(std::abs(now.control.brake_torque_ref_Nm - as_before.control.brake_torque_ref_Nm) < 1e-9);
    if (!std::isnan(now.control.theta_est_N)) {
      CHECK(std::abs(now.control.theta_est_N - theta_N) <= 2.2 * std::abs(as_before.control.theta_est_N - theta_N));
    }
    // Afterwards it changes by no more than a few cycles' share of the fading.
    rig::CycleRecord before = now;
    rig::CycleRecord before_unchanged = as_before;
    double largest_step_Nm = 0.0, largest_unchanged_Nm = 0.0, difference_Nm = 0.0;
    for (int i = 0; i < 200; ++i) {
      const rig::CycleRecord next = changed.step();
      CHECK(next.reason == rig::Reason::none);
      largest_step_Nm =
          std::max(largest_step_Nm, std::abs(next.control.brake_torque_ref_Nm - before.control.brake_torque_ref_Nm));
      const rig::CycleRecord other = unchanged.step();
      const auto moved = [](const rig::CycleRecord& from, const rig::CycleRecord& to) {
        return std::abs(to.control.brake_torque_ref_Nm - from.control.brake_torque_ref_Nm);
      };
      largest_unchanged_Nm = std::max(largest_unchanged_Nm, moved(before_unchanged, other));
      difference_Nm = std::max(difference_Nm, moved(other, next));
      before_unchanged = other;
      before = next;
    }
    CHECK(largest_step_Nm < 2.2 * largest_unchanged_Nm + 0.2);
    CHECK(difference_Nm > 0.05);
  }
}

TEST_CASE("without the bumpless transfer the same change jumps: the test above can fail") {
  Bench bench("adaptive");
  bench.run(40);
  const Adjustment fresh = bench.retuned(double_gains);
  control::SlipInput input{
      .dt_s = 1e-3, .speeds = {140.0, 168.0}, .slip = 0.16, .slip_ref = 0.15, .max_brake_torque_Nm = 9.0};
  auto before = control::make_controller("adaptive", {bench.setup.control, bench.setup.plant.rig});
  before->reset(input);
  input.speeds.omega1_rad_s = 120.0;
  REQUIRE(fresh.controller->take_over(*before));
  const double jump_Nm = std::abs(fresh.controller->step(input).brake_torque_Nm - before->step(input).brake_torque_Nm);
  CHECK(jump_Nm > 0.5);
}

TEST_CASE("a change to the same gains has no effect, bit by bit") {
  for (const auto& entry : control::controllers()) {
    Bench changed{std::string(entry.name)}, unchanged{std::string(entry.name)};
    Adjustment same = changed.retuned([](auto&) {});
    if (!same.controller->take_over(*changed.retuned([](auto&) {}).controller)) continue;
    INFO(entry.name);
    changed.run(300);
    unchanged.run(300);
    REQUIRE(changed.logic.adjustments().put(std::move(same)) == 1);
    for (int i = 0; i < 500; ++i) {
      const rig::CycleRecord a = changed.step(), b = unchanged.step();
      REQUIRE(a.control.brake_torque_ref_Nm == b.control.brake_torque_ref_Nm);
      REQUIRE((a.control.theta_est_N == b.control.theta_est_N || std::isnan(b.control.theta_est_N)));
    }
  }
}

TEST_CASE("a law that cannot take over a state reports that, and a controller of another class is refused") {
  Bench bench("adaptive");
  const Adjustment other = bench.retuned([](auto& o) { o.controller = "pi"; });
  const Adjustment own = bench.retuned([](auto&) {});
  CHECK_FALSE(other.controller->take_over(*own.controller));
  const Adjustment seeking = bench.retuned([](auto& o) { o.controller = "adaptive-peak"; });
  CHECK_FALSE(seeking.controller->take_over(*seeking.controller));
}

TEST_CASE("a changed slip reference is followed, and theta keeps its value") {
  Bench bench("adaptive");
  const double theta_N = bench.run(600).control.theta_est_N;
  REQUIRE(bench.logic.adjustments().put({.kind = Adjustment::Kind::slip_ref, .slip_ref = 0.1}) == 1);
  const rig::CycleRecord now = bench.step();
  CHECK(now.reason == rig::Reason::slip_reference_changed);
  CHECK(now.control.slip_ref == 0.1);
  CHECK(std::abs(now.control.theta_est_N - theta_N) < 0.5);
  CHECK_THAT(bench.run(600).control.slip_est, Catch::Matchers::WithinAbs(0.1, 0.02));
}

TEST_CASE("changes take effect one per cycle, in order, and excess changes are refused") {
  Bench bench("adaptive");
  bench.run(5);
  std::uint32_t taken = 0;
  while (bench.logic.adjustments().put({.kind = Adjustment::Kind::slip_ref, .slip_ref = 0.2}) != 0) ++taken;
  CHECK(taken == 16);
  for (std::uint32_t n = 1; n <= taken; ++n) CHECK(bench.step().reason_value == n);
  CHECK(bench.step().reason == rig::Reason::none);
  CHECK(bench.logic.adjustments().put({.kind = Adjustment::Kind::slip_ref, .slip_ref = 0.2}) == taken + 1);
}

TEST_CASE("hundreds of replaced controllers return to the slow thread") {
  Bench bench("adaptive");
  for (std::uint32_t n = 1; n <= 300; ++n) {
    REQUIRE(bench.logic.adjustments().put(bench.retuned(double_gains)) == n);
    bench.run(2);
  }
}

TEST_CASE("a run that waits stays idle and safe until the start command") {
  test::Setup setup;
  setup.experiment.wait_for_start = true;
  driver::SimDriver driver(setup.plant, {.seed = 1});
  driver.configure();
  driver.activate(0);
  RunLogic logic(test::logic_parts(setup));
  runtime::RunLatch latch;
  std::int64_t now_ns = 0;
  const auto step = [&] {
    rig::Measurement measurement;
    rig::CycleRecord record;
    REQUIRE(driver.read(now_ns, measurement).ok());
    record.command = logic.step(measurement, latch, record);
    now_ns += ms;
    return record;
  };
  for (int i = 0; i < 3000; ++i) {
    const rig::CycleRecord record = step();
    REQUIRE(record.phase == rig::Phase::idle);
    REQUIRE(record.command.motor_duty == 0.0);
  }
  REQUIRE(logic.adjustments().put({}) == 1);
  CHECK(step().reason == rig::Reason::none);
  CHECK(step().reason == rig::Reason::start_command);
  for (int i = 0; i < 60; ++i) static_cast<void>(step());
  CHECK(step().phase == rig::Phase::accelerate);
}

}  // namespace
}  // namespace abs_hil::experiment

// The command gate: limits, faults and the latch.
#include "runtime/command_gate.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>

#include "catch.hpp"
#include "gate_inputs.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test_bench;
using rig::Phase;
using rig::Reason;

TEST_CASE("a sound command passes unchanged") {
  CommandGate gate(GateOptions{});
  const GateResult result = gate.check({.brake_duty = 0.7, .brake_torque_Nm = 4.0}, moderate);
  CHECK(result.action == GateAction::passed);
  CHECK(result.command.brake_duty == 0.7);
  CHECK(result.command.brake_torque_Nm == 4.0);
  CHECK(gate.count(GateAction::passed) == 1);
}

TEST_CASE("duties are limited, and that is counted") {
  CommandGate gate({.motor_duty_max = 0.8, .brake_duty_max = 0.7});
  CHECK(gate.check({.brake_duty = 0.9}, moderate).command.brake_duty == 0.7);
  CHECK(gate.check({.brake_duty = -0.1}, moderate).command.brake_duty == 0.0);
  CHECK(gate.check({.motor_duty = 1.0, .motor_enable = true}, {.now_ns = ms}).command.motor_duty == 0.8);
  CHECK(gate.count(GateAction::brake_clamped) == 2);
  CHECK(gate.count(GateAction::motor_clamped) == 1);
}

TEST_CASE("the motor is off while the brake acts and while it is not enabled") {
  CommandGate gate(GateOptions{});
  const GateResult both = gate.check({.motor_duty = 1.0, .brake_duty = 0.5, .motor_enable = true}, moderate);
  CHECK(both.action == GateAction::motor_blocked_by_brake);
  CHECK(both.command.motor_duty == 0.0);
  CHECK_FALSE(both.command.motor_enable);
  CHECK(both.command.brake_duty == 0.5);
  const GateResult disabled = gate.check({.motor_duty = 1.0}, {.now_ns = ms});
  CHECK(disabled.action == GateAction::motor_blocked_by_disable);
  CHECK(disabled.command.motor_duty == 0.0);
}

TEST_CASE("a value that is not finite latches a fault; from then on only the safe command passes") {
  for (const double bad : {not_a_number, infinite, -infinite}) {
    CommandGate gate(GateOptions{});
    CHECK(is_safe(gate.check({.brake_duty = bad}, moderate).command));
    CHECK(gate.fault() == rig::Reason::command_not_finite);
    const GateResult later = gate.check({.brake_duty = 0.5}, moderate);
    CHECK(is_safe(later.command));
    CHECK(later.action == GateAction::refused);
    CHECK(gate.fault() == rig::Reason::command_not_finite);

    CommandGate blind(GateOptions{});
    CHECK(is_safe(blind.check({.brake_duty = 0.5}, {.speeds = {bad, 1.0}}).command));
    CHECK(blind.fault() == rig::Reason::estimate_not_finite);
    CommandGate other(GateOptions{});
    CHECK(is_safe(other.check({.brake_duty = 0.5}, {.speeds = {1.0, bad}}).command));
    CHECK(other.fault() == rig::Reason::estimate_not_finite);
    CommandGate torque(GateOptions{});
    CHECK(is_safe(torque.check({.brake_torque_Nm = bad}, moderate).command));
    CHECK(torque.fault() == rig::Reason::command_not_finite);
  }
}

TEST_CASE("overspeed of either wheel, either way round, latches; the limit itself does not") {
  const double limit = GateOptions{}.overspeed_rad_s;
  for (const rig::WheelSpeeds speeds : {rig::WheelSpeeds{limit + 0.1, 0.0}, rig::WheelSpeeds{0.0, -limit - 0.1}}) {
    CommandGate gate(GateOptions{});
    CHECK(gate.check({.motor_duty = 1.0, .motor_enable = true}, {.speeds = {limit, limit}}).action ==
          GateAction::passed);
    CHECK(is_safe(gate.check({.motor_duty = 1.0, .motor_enable = true}, {.speeds = speeds}).command));
    CHECK(gate.fault() == rig::Reason::overspeed);
    CHECK(gate.fault_value() == limit + 0.1);
  }
}

TEST_CASE("the first fault stays") {
  CommandGate gate(GateOptions{});
  gate.latch(rig::Reason::driver_read_failed, 2.0);
  gate.latch(rig::Reason::overspeed, 300.0);
  static_cast<void>(gate.check({}, moderate));
  CHECK(gate.fault() == rig::Reason::driver_read_failed);
  CHECK(gate.fault_value() == 2.0);
}

TEST_CASE("a command exactly at the limits passes and is not counted as limited") {
  CommandGate gate({.motor_duty_max = 0.8, .brake_duty_max = 0.7});
  CHECK(gate.check({.brake_duty = 0.7}, moderate).command.brake_duty == 0.7);
  CHECK(gate.check({.motor_duty = 0.8, .motor_enable = true}, moderate).action == GateAction::motor_rate_limited);
  CHECK(gate.check({}, {.now_ns = ms}).command.brake_duty == 0.0);
  CHECK(gate.check({.motor_duty = 0.8, .motor_enable = true}, {.now_ns = 2 * ms}).action == GateAction::passed);
  CHECK(gate.count(GateAction::brake_clamped) == 0);
  CHECK(gate.count(GateAction::motor_clamped) == 0);
}

TEST_CASE("a limit between two steps of the PWM lets the lower one through, and only more than the limit is counted") {
  const auto check = [](double wanted) {
    CommandGate gate({.motor_duty_max = 0.5, .brake_duty_max = 0.5}, any_phase(), {}, 0.0,
                     {.motor = 0.4, .brake = 0.3});
    const GateResult motor = gate.check({.motor_duty = wanted, .motor_enable = true}, moderate);
    const GateResult brake = gate.check({.brake_duty = wanted}, {.now_ns = ms});
    CHECK(motor.command.motor_duty == 0.4);
    CHECK(brake.command.brake_duty == 0.3);
    return std::pair(motor.action, brake.action);
  };
  CHECK(check(0.5) == std::pair(GateAction::passed, GateAction::passed));
  CHECK(check(0.51) == std::pair(GateAction::motor_clamped, GateAction::brake_clamped));
}

TEST_CASE("a torque below 0 becomes 0") {
  CommandGate gate(GateOptions{});
  CHECK(gate.check({.brake_torque_Nm = -1.0}, moderate).command.brake_torque_Nm == 0.0);
}

TEST_CASE("duties rise no faster than their rates by real elapsed time, and fall at once") {
  CommandGate gate({.motor_rate_per_s = 100.0, .brake_rate_per_s = 50.0});
  const auto check = [&](const rig::Command& wanted, std::int64_t at_ms) {
    return gate.check(wanted, {.phase = Phase::brake, .now_ns = at_ms * ms});
  };
  static_cast<void>(check({.brake_duty = 0.2}, 0));  // the first: the outputs have been 0 for long
  CHECK(gate.count(GateAction::brake_rate_limited) == 0);
  CHECK(check({.brake_duty = 1.0}, 2).command.brake_duty == Approx(0.3));
  CHECK(gate.count(GateAction::brake_rate_limited) == 1);
  CHECK(check({.brake_duty = 0.4}, 4).command.brake_duty == 0.4);  // just what the rate allows
  CHECK(gate.count(GateAction::brake_rate_limited) == 1);
  CHECK(check({.brake_duty = 1.0}, 14).command.brake_duty == Approx(0.9));
  CHECK(check({.brake_duty = 0.0}, 15).command.brake_duty == 0.0);
  CHECK(check({.brake_duty = 1.0}, 16).command.brake_duty == Approx(0.05));
  const GateResult motor = check({.motor_duty = 0.7, .motor_enable = true}, 18);
  CHECK(motor.command.motor_duty == Approx(0.2));
  CHECK(motor.action == GateAction::motor_rate_limited);
  CHECK(gate.count(GateAction::motor_rate_limited) == 1);
  CHECK(check({.motor_duty = 0.1, .motor_enable = true}, 19).command.motor_duty == 0.1);
  // Nothing rises while time stands still or runs backwards.
  CHECK(check({.motor_duty = 0.2, .motor_enable = true}, 19).command.motor_duty == Approx(0.1));
}

TEST_CASE("the rate limits the brake's torque: the dead zone is crossed at once") {
  CommandGate gate({.brake_rate_per_s = 50.0}, any_phase(), {}, 0.4);
  const auto check = [&](double duty, std::int64_t at_ms) {
    return gate.check({.brake_duty = duty}, {.phase = Phase::brake, .now_ns = at_ms * ms}).command.brake_duty;
  };
  CHECK(check(0.0, 0) == 0.0);
  CHECK(check(0.4, 1) == 0.4);  // no torque yet
  CHECK(check(1.0, 2) == Approx(0.45));
  CHECK(check(0.0, 3) == 0.0);
  CHECK(check(1.0, 4) == Approx(0.45));  // 1 ms of torque beyond u0
  CHECK(check(1.0, 6) == Approx(0.55));
  CHECK(gate.count(GateAction::brake_rate_limited) == 3);
}

TEST_CASE("a rise goes on from what was sent, but a PWM's steps do not swallow a slow one") {
  CommandGate gate({.motor_rate_per_s = 0.1, .brake_rate_per_s = 0.1});
  const auto duty_at = [&](std::int64_t at_ms) {
    return gate.check({.motor_duty = 1.0, .motor_enable = true}, {.phase = Phase::accelerate, .now_ns = at_ms * ms})
        .command.motor_duty;
  };
  static_cast<void>(gate.check({}, {.now_ns = 0}));
  // 0.1/s is less than half a step of 8 bits in each cycle, which the driver rounds to 0.
  double duty = 0.0;
  for (int n = 1; n <= 1000; ++n) {
    duty = duty_at(n);
    gate.note_sent({.motor_duty = std::round(duty * 255.0) / 255.0, .motor_enable = true});
  }
  CHECK(duty == Approx(0.1));
  // The board did not take the last commands: the output is still 0.
  gate.note_sent({});
  CHECK(duty_at(1001) < 0.003);
}

TEST_CASE("the checks of the wheels count the brake as it was sent, not as it was wanted") {
  const rig::RigParameters rig;
  const GateOptions options;
  CommandGate gate(options, any_phase(), plausibility_limits(rig, false, options));
  // The brake is wanted for a second, but the driver sent none, and the wheels keep their speed.
  double angle_rad = 0.0;
  for (int n = 0; n < 1000; ++n) {
    const auto counts = static_cast<std::int32_t>(angle_rad / (2.0 * std::numbers::pi) * 4096.0);
    CHECK(gate.check_measurement({.time_ns = n * ms, .upper_counts = counts, .lower_counts = counts}, n * ms));
    static_cast<void>(
        gate.check({.brake_duty = 0.9}, {.speeds = {100.0, 100.0}, .phase = Phase::brake, .now_ns = n * ms}));
    gate.note_sent({});
    angle_rad += 0.1;
  }
  CHECK(gate.fault() == rig::Reason::none);
}

TEST_CASE("motor and brake act only in the phases whose plan has them, together only where it says so") {
  PhasePermissions permissions{};
  permissions[static_cast<std::size_t>(Phase::accelerate)] = {.motor = true};
  permissions[static_cast<std::size_t>(Phase::brake)] = {.brake = true};
  permissions[static_cast<std::size_t>(Phase::hold)] = {.motor = true, .brake = true, .together = true};
  const rig::Command driving{.motor_duty = 0.5, .motor_enable = true};
  const rig::Command braking{.brake_duty = 0.5, .brake_torque_Nm = 1.0};
  const rig::Command both{.motor_duty = 0.5, .brake_duty = 0.5, .motor_enable = true, .brake_torque_Nm = 1.0};
  const auto in = [&](Phase phase, const rig::Command& wanted) {
    CommandGate gate(GateOptions{}, permissions);
    return gate.check(wanted, {.phase = phase});
  };
  CHECK(in(Phase::accelerate, driving).action == GateAction::passed);
  CHECK(in(Phase::accelerate, driving).command.motor_enable);
  CHECK(in(Phase::brake, braking).action == GateAction::passed);
  CHECK(in(Phase::hold, both).action == GateAction::passed);
  CHECK(in(Phase::hold, both).command.motor_duty == 0.5);
  CHECK(in(Phase::brake, driving).action == GateAction::motor_blocked_by_phase);
  CHECK(is_safe(in(Phase::brake, driving).command));
  CHECK(in(Phase::accelerate, braking).action == GateAction::brake_blocked_by_phase);
  CHECK(is_safe(in(Phase::accelerate, braking).command));
  CHECK(in(Phase::accelerate, {.brake_torque_Nm = 1.0}).action == GateAction::brake_blocked_by_phase);
  for (const Phase phase : {Phase::idle, Phase::coast, Phase::stopped, Phase::fault}) {
    CHECK(is_safe(in(phase, both).command));
    CHECK(is_safe(in(phase, driving).command));
    CHECK(is_safe(in(phase, braking).command));
  }
}

TEST_CASE("every action is counted, several of one command too") {
  CommandGate gate({.motor_duty_max = 0.5, .brake_duty_max = 0.5});
  static_cast<void>(gate.check({}, moderate));
  CHECK(gate.count(GateAction::passed) == 1);
  static_cast<void>(gate.check({.motor_duty = 0.9, .brake_duty = 0.9}, {.now_ns = ms}));
  gate.latch(Reason::overspeed, 1.0);
  static_cast<void>(gate.check({}, moderate));
  static_cast<void>(gate.check({}, moderate));
  const rig::GateCounts counts = gate.counts();
  CHECK(counts[static_cast<std::size_t>(GateAction::passed)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::motor_clamped)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::brake_clamped)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::motor_blocked_by_disable)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::refused)] == 2);
  CHECK(rig::interventions(counts) == 5);
  CHECK(rig::name_of(GateAction::brake_blocked_by_phase) == "brake_blocked_by_phase");
}

TEST_CASE("a motor that is not enabled stays disabled, and the result tells the actions on this command only") {
  CommandGate gate(GateOptions{});
  CHECK_FALSE(gate.check({.motor_duty = 0.5}, moderate).command.motor_enable);
  const GateResult next = gate.check({.motor_enable = true}, {.now_ns = ms});
  CHECK(next.action == GateAction::passed);
  CHECK(next.command.motor_enable);
  CHECK(gate.fault() == Reason::none);
  CHECK(gate.fault_value() == 0.0);
}

TEST_CASE("after a duty that the board did not take, the next rise begins at what it took and half a step of 8 bits") {
  const double half_step = 0.5 / 255.0;
  CommandGate gate({.motor_rate_per_s = 1.0, .brake_rate_per_s = 1.0});
  std::ignore = gate.check({.brake_duty = 0.5}, {.phase = Phase::brake, .now_ns = 0});
  gate.note_sent({.brake_duty = 0.2});
  CHECK(gate.check({.brake_duty = 0.5}, {.phase = Phase::brake, .now_ns = 10 * ms}).command.brake_duty ==
        Approx(0.2 + half_step + 0.01).epsilon(1e-9));
  CommandGate motor({.motor_rate_per_s = 1.0, .brake_rate_per_s = 1.0});
  std::ignore = motor.check({.motor_duty = 0.5, .motor_enable = true}, {.now_ns = 0});
  motor.note_sent({.motor_duty = 0.2, .motor_enable = true});
  CHECK(motor.check({.motor_duty = 0.5, .motor_enable = true}, {.now_ns = 10 * ms}).command.motor_duty ==
        Approx(0.2 + half_step + 0.01).epsilon(1e-9));
}

TEST_CASE("a clock that goes back never makes a duty negative") {
  CommandGate gate({.motor_rate_per_s = 10.0, .brake_rate_per_s = 10.0});
  const rig::Command wanted{.brake_duty = 0.5, .brake_torque_Nm = 1.0};
  static_cast<void>(gate.check(wanted, {{100.0, 100.0}, Phase::brake, 1'000 * ms}));
  for (const std::int64_t now_ns : {999 * ms, 0 * ms, -1'000'000 * ms}) {
    const rig::Command sent = gate.check(wanted, {{100.0, 100.0}, Phase::brake, now_ns}).command;
    CHECK(sent.brake_duty >= 0.0);
    CHECK(sent.brake_duty <= 0.5);
  }
  CommandGate motor({.motor_rate_per_s = 10.0, .brake_rate_per_s = 10.0});
  const rig::Command drive{.motor_duty = 0.5, .motor_enable = true};
  static_cast<void>(motor.check(drive, {{100.0, 100.0}, Phase::accelerate, 1'000 * ms}));
  CHECK(motor.check(drive, {{100.0, 100.0}, Phase::accelerate, 0}).command.motor_duty >= 0.0);
}

TEST_CASE("a driver that says it sent what is no duty is a fault, and nothing follows but the safe command") {
  for (const double said : {not_a_number, -1.0, 1.5, infinite}) {
    for (const bool motor : {false, true}) {
      CommandGate gate(GateOptions{});
      const rig::Command wanted{.brake_duty = 0.5, .brake_torque_Nm = 1.0};
      static_cast<void>(gate.check(wanted, moderate));
      rig::Command sent = wanted;
      (motor ? sent.motor_duty : sent.brake_duty) = said;
      gate.note_sent(sent);
      CAPTURE(said, motor);
      CHECK(gate.fault() == Reason::driver_write_failed);
      for (int cycle = 1; cycle < 5; ++cycle) {
        CHECK(is_safe(gate.check(wanted, {{100.0, 100.0}, Phase::brake, cycle * ms}).command));
      }
    }
  }
}

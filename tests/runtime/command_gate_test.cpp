#include "abs_hil/runtime/command_gate.hpp"

#include <limits>

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;

namespace {
constexpr rig::WheelSpeeds moderate{100.0, 100.0};
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

bool is_safe(const rig::Command& command) {
  return command.motor_duty == 0.0 && command.brake_duty == 0.0 && !command.motor_enable &&
         command.brake_torque_Nm == 0.0;
}
}  // namespace

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
  CHECK(gate.check({.motor_duty = 1.0, .motor_enable = true}, moderate).command.motor_duty == 0.8);
  CHECK(gate.count(GateAction::brake_clamped) == 2);
  CHECK(gate.count(GateAction::motor_clamped) == 1);
}

TEST_CASE("the motor never turns against the brake, nor without its enable") {
  CommandGate gate(GateOptions{});
  const GateResult both = gate.check({.motor_duty = 1.0, .brake_duty = 0.5, .motor_enable = true}, moderate);
  CHECK(both.action == GateAction::motor_blocked_by_brake);
  CHECK(both.command.motor_duty == 0.0);
  CHECK_FALSE(both.command.motor_enable);
  CHECK(both.command.brake_duty == 0.5);
  const GateResult disabled = gate.check({.motor_duty = 1.0}, moderate);
  CHECK(disabled.action == GateAction::motor_blocked_by_disable);
  CHECK(disabled.command.motor_duty == 0.0);
}

TEST_CASE("what is not finite latches a fault; from then on only the safe command passes") {
  for (const double bad : {not_a_number, infinite, -infinite}) {
    CommandGate gate(GateOptions{});
    CHECK(is_safe(gate.check({.brake_duty = bad}, moderate).command));
    CHECK(gate.fault() == rig::Reason::command_not_finite);
    const GateResult later = gate.check({.brake_duty = 0.5}, moderate);
    CHECK(is_safe(later.command));
    CHECK(later.action == GateAction::refused);
    CHECK(later.fault == rig::Reason::command_not_finite);

    CommandGate blind(GateOptions{});
    CHECK(is_safe(blind.check({.brake_duty = 0.5}, {bad, 1.0}).command));
    CHECK(blind.fault() == rig::Reason::estimate_not_finite);
  }
}

TEST_CASE("overspeed of either wheel, either way round, latches; the limit itself does not") {
  const double limit = GateOptions{}.overspeed_rad_s;
  for (const rig::WheelSpeeds speeds : {rig::WheelSpeeds{limit + 0.1, 0.0}, rig::WheelSpeeds{0.0, -limit - 0.1}}) {
    CommandGate gate(GateOptions{});
    CHECK(gate.check({.motor_duty = 1.0, .motor_enable = true}, {limit, limit}).action == GateAction::passed);
    CHECK(is_safe(gate.check({.motor_duty = 1.0, .motor_enable = true}, speeds).command));
    CHECK(gate.fault() == rig::Reason::overspeed);
  }
}

TEST_CASE("the first fault stays") {
  CommandGate gate(GateOptions{});
  gate.latch(rig::Reason::driver_read_failed, 2.0);
  gate.latch(rig::Reason::overspeed, 300.0);
  CHECK(gate.fault() == rig::Reason::driver_read_failed);
  CHECK(gate.fault_value() == 2.0);
}

#include "abs_hil/runtime/command_gate.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::runtime {

void CommandGate::latch(rig::Reason fault, double value) noexcept {
  if (fault_ != rig::Reason::none) return;
  fault_ = fault;
  fault_value_ = value;
}

void CommandGate::watch_board(const rig::Measurement& measurement) noexcept {
  if (const std::uint32_t flags = measurement.trip_flags; flags != 0) {
    latch(flags == rig::trip::supply ? rig::Reason::board_supply_tripped : rig::Reason::board_interlock_tripped,
          static_cast<double>(flags));
  } else if (measurement.supply_V < options_.supply_min_V) {
    latch(rig::Reason::board_supply_low, measurement.supply_V);
  } else if (measurement.temperature_C > options_.temperature_max_C) {
    latch(rig::Reason::board_too_hot, measurement.temperature_C);
  }
}

GateResult CommandGate::check(const rig::Command& wanted, const rig::WheelSpeeds& speeds) noexcept {
  for (const double value : {wanted.motor_duty, wanted.brake_duty, wanted.brake_torque_Nm}) {
    if (!std::isfinite(value)) latch(rig::Reason::command_not_finite, value);
  }
  const double fastest = std::max(std::abs(speeds.omega1_rad_s), std::abs(speeds.omega2_rad_s));
  if (!std::isfinite(speeds.omega1_rad_s) || !std::isfinite(speeds.omega2_rad_s)) {
    latch(rig::Reason::estimate_not_finite, speeds.omega1_rad_s + speeds.omega2_rad_s);
  } else if (fastest > options_.overspeed_rad_s) {
    latch(rig::Reason::overspeed, fastest);
  }

  GateResult result;
  if (fault_ != rig::Reason::none) {
    result.action = GateAction::refused;
    result.fault = fault_;
    result.fault_value = fault_value_;
  } else {
    result.command = wanted;
    rig::Command& command = result.command;
    command.brake_torque_Nm = std::max(0.0, wanted.brake_torque_Nm);
    command.brake_duty = std::clamp(wanted.brake_duty, 0.0, options_.brake_duty_max);
    if (command.brake_duty != wanted.brake_duty) result.action = GateAction::brake_clamped;
    command.motor_duty = std::clamp(wanted.motor_duty, 0.0, options_.motor_duty_max);
    if (command.motor_duty != wanted.motor_duty) result.action = GateAction::motor_clamped;
    if (command.motor_duty > 0.0 && !command.motor_enable) {
      command.motor_duty = 0.0;
      result.action = GateAction::motor_blocked_by_disable;
    }
    if (command.motor_duty > 0.0 && (command.brake_duty > 0.0 || command.brake_torque_Nm > 0.0)) {
      command.motor_duty = 0.0;
      command.motor_enable = false;
      result.action = GateAction::motor_blocked_by_brake;
    }
  }
  ++counts_[static_cast<std::size_t>(result.action)];
  return result;
}

}  // namespace abs_hil::runtime

#include "runtime/command_gate.hpp"

#include <algorithm>
#include <cmath>

#include "abs_hil/rig/time_units.hpp"
#include "runtime/single_writer.hpp"

namespace abs_hil::runtime {

namespace {

using rig::Reason;

/// Tolerance for rounding: a step exactly at the limit must pass.
constexpr double rounding = 1e-9;
/// A longer reading was delayed, and its time stamp may not belong to its counters.
constexpr std::int64_t prompt_reading_ns = 500'000;

/// A driver may round a duty down by so much: half a step of 8 bits, the coarsest PWM.
constexpr double rounded_down_most = 0.5 / 255.0;

bool brakes(const rig::Command& command) noexcept { return command.brake_duty > 0.0 || command.brake_torque_Nm > 0.0; }

void stop_motor(rig::Command& command) noexcept {
  command.motor_duty = 0.0;
  command.motor_enable = false;
}

}  // namespace

void CommandGate::latch(Reason fault, double value) noexcept {
  if (fault_ != Reason::none) return;
  fault_ = fault;
  fault_value_ = value;
}

void CommandGate::note(GateAction action) noexcept {
  last_action_ = action;
  add_as_single_writer(counts_[static_cast<std::size_t>(action)], std::uint64_t{1});
}

rig::GateCounts CommandGate::counts() const noexcept {
  rig::GateCounts counts{};
  std::transform(counts_.begin(), counts_.end(), counts.begin(),
                 [](const auto& count) { return count.load(std::memory_order_relaxed); });
  return counts;
}

bool CommandGate::check_measurement(const rig::Measurement& measurement, std::int64_t now_ns,
                                    std::int64_t reading_ns) noexcept {
  check_board(measurement);
  if (checks_wheels_) check_wheels(measurement, now_ns, reading_ns <= prompt_reading_ns);
  return speed_windows_.usable();
}

void CommandGate::check_board(const rig::Measurement& measurement) noexcept {
  if (const std::uint32_t flags = measurement.trip_flags; flags != 0) {
    latch(flags == rig::trip::supply ? Reason::board_supply_tripped : Reason::board_interlock_tripped, flags);
  }
  if (measurement.supply_V < options_.supply_min_V) latch(Reason::board_supply_low, measurement.supply_V);
  if (measurement.temperature_C > options_.temperature_max_C) latch(Reason::board_too_hot, measurement.temperature_C);
  // The board reported this value before and no longer does. The fault's value is 1 for supply, 2 for temperature.
  if (supply_known_ && std::isnan(measurement.supply_V)) latch(Reason::board_health_lost, 1.0);
  if (temperature_known_ && std::isnan(measurement.temperature_C)) latch(Reason::board_health_lost, 2.0);
  supply_known_ = !std::isnan(measurement.supply_V);
  temperature_known_ = !std::isnan(measurement.temperature_C);
}

void CommandGate::check_wheels(const rig::Measurement& measurement, std::int64_t now_ns, bool prompt) noexcept {
  CheckResult result = speed_windows_.update(measurement, now_ns, sent_, prompt);
  if (speed_windows_.complete()) {
    result = encoders_.update(speed_windows_.speed_window());
    if (result.sound()) result = response_.update(speed_windows_.speed_window(), encoders_.brake_torque_Nm());
  }
  latch(result.reason, result.value);
}

void CommandGate::require_finite(const rig::Command& wanted, const rig::WheelSpeeds& speeds) noexcept {
  for (const double value : {wanted.motor_duty, wanted.brake_duty, wanted.brake_torque_Nm}) {
    if (!std::isfinite(value)) latch(Reason::command_not_finite, value);
  }
  for (const double speed : {speeds.omega1_rad_s, speeds.omega2_rad_s}) {
    if (!std::isfinite(speed)) latch(Reason::estimate_not_finite, speed);
    if (std::abs(speed) > options_.overspeed_rad_s) latch(Reason::overspeed, std::abs(speed));
  }
}

double CommandGate::limited(double duty, double most, GateAction action) noexcept {
  const double within = std::clamp(duty, 0.0, most);
  if (within != duty) note(action);
  return within;
}

double CommandGate::rising(double duty, double before, double rate_per_s, double elapsed_s,
                           GateAction action) noexcept {
  const double most = before + rate_per_s * elapsed_s;
  if (duty <= most + rounding) return duty;
  note(action);
  return most;
}

void CommandGate::interlock(rig::Command& command, const PhasePermission& may) noexcept {
  if (command.motor_duty > 0.0 && !command.motor_enable) {
    stop_motor(command);
    note(GateAction::motor_blocked_by_disable);
  }
  if (command.motor_duty > 0.0 && !may.motor) {
    stop_motor(command);
    note(GateAction::motor_blocked_by_phase);
  }
  if (brakes(command) && !may.brake) {
    command.brake_duty = 0.0;
    command.brake_torque_Nm = 0.0;
    note(GateAction::brake_blocked_by_phase);
  }
  if (command.motor_duty > 0.0 && brakes(command) && !may.together) {
    stop_motor(command);
    note(GateAction::motor_blocked_by_brake);
  }
}

/// Flattened (all calls inlined): the calls would cost a tenth of its time in each cycle.
[[gnu::flatten]] GateResult CommandGate::check(const rig::Command& wanted, const GateInput& input) noexcept {
  last_action_ = GateAction::passed;
  require_finite(wanted, input.speeds);
  GateResult result;
  if (fault_ != Reason::none) {
    note(GateAction::refused);
    result.fault = fault_;
    result.fault_value = fault_value_;
  } else {
    rig::Command& command = result.command;
    command = wanted;
    command.brake_torque_Nm = std::max(0.0, wanted.brake_torque_Nm);
    command.brake_duty = limited(wanted.brake_duty, options_.brake_duty_max, GateAction::brake_clamped);
    command.motor_duty = limited(wanted.motor_duty, options_.motor_duty_max, GateAction::motor_clamped);
    // The first command is not rate-limited: the outputs have been 0 for longer than any rise takes.
    if (has_sent_) {
      const double elapsed_s = static_cast<double>(input.now_ns - sent_ns_) * rig::s_per_ns;
      command.brake_duty = rising(command.brake_duty, std::max(brake_risen_, brake_free_duty_),
                                  options_.brake_rate_per_s, elapsed_s, GateAction::brake_rate_limited);
      command.motor_duty = rising(command.motor_duty, motor_risen_, options_.motor_rate_per_s, elapsed_s,
                                  GateAction::motor_rate_limited);
    }
    interlock(command, permissions_[static_cast<std::size_t>(input.phase)]);
    if (last_action_ == GateAction::passed) note(GateAction::passed);
  }
  sent_ = result.command;
  brake_risen_ = result.command.brake_duty;
  motor_risen_ = result.command.motor_duty;
  sent_ns_ = input.now_ns;
  has_sent_ = true;
  result.action = last_action_;
  return result;
}

/// A rise goes on from the unrounded duty: steps of the PWM must not swallow a slow one. If the driver sent much less,
/// the rise goes on from that.
void CommandGate::note_sent(const rig::Command& sent) noexcept {
  brake_risen_ = std::min(brake_risen_, sent.brake_duty + rounded_down_most);
  motor_risen_ = std::min(motor_risen_, sent.motor_duty + rounded_down_most);
  sent_ = sent;
}

}  // namespace abs_hil::runtime

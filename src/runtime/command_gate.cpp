// Judges a command and the measurements of each cycle; after a fault only the safe command passes.
#include "runtime/command_gate.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/cycle_statistics.hpp"

namespace abs_hil::runtime {

namespace {

using rig::Reason;

bool brakes(const rig::Command& command) noexcept { return command.brake_duty > 0.0 || command.brake_torque_Nm > 0.0; }

void stop_motor(rig::Command& command) noexcept {
  command.motor_duty = 0.0;
  command.motor_enable = false;
}

}  // namespace

double CommandGate::unjudged_share() const noexcept {
  const auto watched_ns = static_cast<double>(watched_ns_.load(std::memory_order_relaxed));
  return watched_ns > 0.0 ? static_cast<double>(unjudged_ns_.load(std::memory_order_relaxed)) / watched_ns : 0.0;
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

[[gnu::flatten]] bool CommandGate::check_measurement(const rig::Measurement& measurement, std::int64_t now_ns,
                                                     std::int64_t reading_ns) noexcept {
  check_board(measurement);
  if (checks_wheels_) check_wheels(measurement, now_ns, reading_ns);
  return speed_windows_.usable();
}

void CommandGate::check_board(const rig::Measurement& measurement) noexcept {
  if (const std::uint32_t flags = measurement.trip_flags; flags != 0) {
    latch(flags == rig::trip::supply ? Reason::board_supply_tripped : Reason::board_interlock_tripped, flags);
  }
  if (measurement.supply_V < options_.supply_min_V || measurement.supply_V <= 0.0)
    latch(Reason::board_supply_low, measurement.supply_V);
  if (measurement.temperature_C > options_.temperature_max_C) latch(Reason::board_too_hot, measurement.temperature_C);
  // The board reported this value before and no longer does. The fault's value is 1 for supply, 2 for temperature.
  if (supply_known_ && std::isnan(measurement.supply_V)) latch(Reason::board_health_lost, 1.0);
  if (temperature_known_ && std::isnan(measurement.temperature_C)) latch(Reason::board_health_lost, 2.0);
  supply_known_ = !std::isnan(measurement.supply_V);
  temperature_known_ = !std::isnan(measurement.temperature_C);
}

void CommandGate::check_wheels(const rig::Measurement& measurement, std::int64_t now_ns,
                               std::int64_t reading_ns) noexcept {
  CheckResult result = speed_windows_.update(measurement, now_ns, sent_, reading_ns);
  if (speed_windows_.complete()) {
    result = encoders_.update(speed_windows_.speed_window());
    if (result.sound()) result = response_.update(speed_windows_.speed_window(), encoders_.brake_torque_Nm());
  }
  latch(result.reason, result.value);
  require_verdict(now_ns);
}

void CommandGate::require_verdict(std::int64_t now_ns) noexcept {
  const std::int64_t since_ns = watched_until_ns_ < 0 ? 0 : now_ns - watched_until_ns_;
  watched_until_ns_ = now_ns;
  add_as_single_writer(watched_ns_, since_ns);
  if (speed_windows_.complete()) {
    without_verdict_ns_ = 0;
    return;
  }
  if (speed_windows_.overdue()) add_as_single_writer(unjudged_ns_, since_ns);
  // Pulses of an output count together: a verdict alone ends the time.
  if (rig::acts(sent_)) without_verdict_ns_ += since_ns;
  if (without_verdict_ns_ > judge_within_ns_) {
    latch(Reason::checks_cannot_judge, static_cast<double>(without_verdict_ns_) * rig::s_per_ns);
  }
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

double CommandGate::limited(double duty, double most, double sendable, GateAction action) noexcept {
  const double within = std::clamp(duty, 0.0, most);
  if (within != duty) note(action);
  return std::min(within, sendable);
}

double CommandGate::rising(double duty, double before, double rate_per_s, double elapsed_s,
                           GateAction action) noexcept {
  const double most = before + rate_per_s * std::max(0.0, elapsed_s);  // a clock that goes back gives no time
  if (duty <= most + rise_rounding) return duty;
  note(action);
  return most;
}

/// The command that may follow a fault: the motor is off, and the brake holds at most `fault_brake_duty`, if no fault
/// bars it and the logic wants it.
rig::Command CommandGate::after_fault(const rig::Command& wanted, std::int64_t now_ns) noexcept {
  if (fault_ns_ < 0) fault_ns_ = now_ns;
  const double held_s = static_cast<double>(now_ns - fault_ns_) * rig::s_per_ns;
  const double duty = std::min(wanted.brake_duty, options_.fault_brake_duty);
  const bool holds = duty > 0.0 && std::isfinite(wanted.brake_torque_Nm);  // false for NaN
  if (!holds || brake_barred_by() != Reason::none || held_s > options_.fault_brake_limit_s) return {};
  return {.brake_duty = duty, .brake_torque_Nm = wanted.brake_torque_Nm * (duty / wanted.brake_duty)};
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
  const bool faulty = fault() != Reason::none;
  rig::Command& command = result.command;
  command = faulty ? after_fault(wanted, input.now_ns) : wanted;
  if (!faulty || rig::acts(command)) {
    command.brake_torque_Nm = std::max(0.0, command.brake_torque_Nm);
    command.brake_duty =
        limited(command.brake_duty, options_.brake_duty_max, sendable_.brake, GateAction::brake_clamped);
    command.motor_duty =
        limited(command.motor_duty, options_.motor_duty_max, sendable_.motor, GateAction::motor_clamped);
    // The first command is not rate-limited: the outputs have been 0 for longer than any rise takes.
    if (has_sent_) {
      const double elapsed_s = static_cast<double>(input.now_ns - sent_ns_) * rig::s_per_ns;
      command.brake_duty = rising(command.brake_duty, std::max(brake_risen_, brake_free_duty_),
                                  options_.brake_rate_per_s, elapsed_s, GateAction::brake_rate_limited);
      command.motor_duty = rising(command.motor_duty, motor_risen_, options_.motor_rate_per_s, elapsed_s,
                                  GateAction::motor_rate_limited);
    }
    interlock(command, permissions_[static_cast<std::size_t>(input.phase)]);
    if (!faulty && last_action_ == GateAction::passed) note(GateAction::passed);
  }
  if (faulty) note(GateAction::refused);
  sent_ = result.command;
  brake_risen_ = result.command.brake_duty;
  motor_risen_ = result.command.motor_duty;
  sent_ns_ = input.now_ns;
  has_sent_ = true;
  result.action = last_action_;
  return result;
}

/// A rise goes on from the unrounded duty: steps of the PWM must not swallow a slow one. If the driver sent much less,
/// the rise goes on from that. It is a fault if the driver names a duty outside 0 to 1: what acts is then unknown.
void CommandGate::note_sent(const rig::Command& sent) noexcept {
  for (const double duty : {sent.motor_duty, sent.brake_duty}) {
    if (duty >= 0.0 && duty <= 1.0) continue;  // false for NaN
    latch(Reason::driver_write_failed, duty);
    return;
  }
  brake_risen_ = std::min(brake_risen_, sent.brake_duty + rounded_down_most);
  motor_risen_ = std::min(motor_risen_, sent.motor_duty + rounded_down_most);
  sent_ = sent;
}

}  // namespace abs_hil::runtime

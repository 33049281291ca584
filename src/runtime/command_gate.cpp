// Judges a command and the measurements of each cycle; after a fault only the safe command passes.
#include "runtime/command_gate.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "runtime/cycle_statistics.hpp"

namespace abs_hil::runtime {

namespace {

using rig::Reason;

static_assert(GATE_BRAKE_BY_PHASE == static_cast<int>(GateAction::brake_blocked_by_phase));
static_assert(GATE_MOTOR_BY_BRAKE == static_cast<int>(GateAction::motor_blocked_by_brake));
static_assert(GATE_MOTOR_RATE == static_cast<int>(GateAction::motor_rate_limited));
static_assert(GATE_REFUSED == static_cast<int>(GateAction::refused));

}  // namespace

double CommandGate::unjudged_share() const noexcept {
  const auto watched_ns = static_cast<double>(watched_ns_.load(std::memory_order_relaxed));
  return watched_ns > 0.0 ? static_cast<double>(unjudged_ns_.load(std::memory_order_relaxed)) / watched_ns : 0.0;
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

/// Flattened (all calls inlined): the calls would cost a tenth of its time in each cycle.
[[gnu::flatten]] GateResult CommandGate::check(const rig::Command& wanted, const GateInput& input) noexcept {
  require_finite(wanted, input.speeds);
  // Member by member: a cast of the whole would go through memory.
  const PhasePermission& may = permissions_[static_cast<std::size_t>(input.phase)];
  const gate_wish wish{.command = {wanted.motor_duty, wanted.brake_duty, wanted.motor_enable, wanted.brake_torque_Nm},
                       .may = {may.motor, may.brake, may.together},
                       .faulty = fault() != Reason::none,
                       .brake_barred = brake_barred_by() != Reason::none,
                       .now_ns = input.now_ns};
  gate_deeds deeds{};
  const gate_command sent = gate_decide(&limits_, &state_, &wish, &deeds);
  sent_ = {sent.motor_duty, sent.brake_duty, sent.motor_enable, sent.brake_torque_Nm};
  const auto count = [this](unsigned action) { add_as_single_writer(counts_[action], std::uint64_t{1}); };
  if (deeds.bits == 0) {
    count(GATE_PASSED);
  } else {
    for (unsigned left = deeds.bits; left != 0; left &= left - 1) count(static_cast<unsigned>(std::countr_zero(left)));
  }
  return {.command = sent_, .action = static_cast<GateAction>(deeds.last)};
}

/// It is a fault if the driver names a duty outside 0 to 1: what acts is then unknown.
void CommandGate::note_sent(const rig::Command& sent) noexcept {
  for (const double duty : {sent.motor_duty, sent.brake_duty}) {
    if (duty >= 0.0 && duty <= 1.0) continue;  // false for NaN
    latch(Reason::driver_write_failed, duty);
    return;
  }
  gate_note_sent(&state_, sent.motor_duty, sent.brake_duty);
  sent_ = sent;
}

}  // namespace abs_hil::runtime

#include "study/lanes/lane_parts.hpp"

#include <algorithm>
#include <limits>

#include "runtime/plausibility_limits.hpp"

namespace abs_hil::study::lanes {

using experiment::BrakeAction;
using experiment::EndKind;

bool plan_sequence(const config::Plan& plan, const config::Settings& settings, LaneSequence<double>& sequence) {
  if (plan.phases.size() < 2 || plan.limits.distance_m < std::numeric_limits<double>::infinity()) return false;
  const experiment::PhasePlan& brake = plan.phases[0];
  const experiment::PhasePlan& hold = plan.phases[1];
  const auto drives = [](const experiment::PhasePlan& phase) {
    return phase.motor_duty > 0.0 || !phase.motor_profile.empty() || phase.wheels_apart || !phase.question.empty();
  };
  if (drives(brake) || drives(hold)) return false;
  if (brake.phase != rig::Phase::brake || brake.brake != BrakeAction::slip_control || !brake.slip_ref_profile.empty())
    return false;
  if (hold.phase == rig::Phase::brake || !hold.brake_profile.empty() ||
      (hold.brake != BrakeAction::torque && hold.brake != BrakeAction::released))
    return false;
  for (const experiment::EndCondition& end : brake.ends_on) {
    if (end.kind != EndKind::car_speed_below) return false;
    sequence.slow_m_s = std::max(sequence.slow_m_s, end.value);
  }
  for (const experiment::EndCondition& end : hold.ends_on) {
    if (end.kind != EndKind::standstill) return false;
  }
  sequence.brake_limit_s = brake.time_limit_s;
  sequence.hold_limit_s = hold.time_limit_s;
  sequence.run_limit_s = plan.limits.run_time_s;
  sequence.hold_torque_Nm = hold.brake == BrakeAction::torque ? hold.brake_torque_Nm : 0.0;
  // The first cycle must not be slow: two slow ones in a row end slip control.
  return settings.model.wheels.r2_m * settings.experiment.start_speed_rad_s > sequence.slow_m_s;
}

bool plan_gate(LaneSettings::Parts& parts) {
  const config::Settings& s = parts.settings;
  const runtime::PlausibilityLimits limits = runtime::plausibility_limits(s.model, s.plant.ideal_actuator, s.gate);
  const runtime::SpeedWindows windows(limits);
  const std::int64_t least_ns = std::max(runtime::least_speed_window_ns, windows.resolving_ns());
  const std::int64_t cycles = (least_ns + parts.period_ns - 1) / parts.period_ns;
  constexpr std::int64_t most_cycles = 64;
  if (cycles > most_cycles || static_cast<double>(cycles * parts.period_ns) * rig::s_per_ns > s.gate.judge_within_s)
    return false;
  parts.window_cycles = static_cast<std::uint32_t>(cycles);
  parts.gate.watch = runtime::WheelWatch<double>(limits);
  parts.gate.momentum = runtime::MomentumWatch<double>(limits);
  parts.gate.upper = {limits.upper_gain_rad_s2, limits.upper_loss_rad_s2, limits.overspeed_rad_s};
  parts.gate.lower = {limits.lower_gain_rad_s2, limits.lower_loss_rad_s2, limits.overspeed_rad_s};
  parts.gate.brake = rig::BasicBrake<double>(s.model.brake);
  parts.gate.rad_per_count = limits.rad_per_count;
  parts.gate.sure_counts = windows.sure_counts();
  parts.gate.window_s = static_cast<double>(cycles * parts.period_ns) * rig::s_per_ns;
  parts.gate.overspeed_rad_s = limits.overspeed_rad_s;
  parts.gate.brake_duty_max = rig::duty_at_most(s.gate.brake_duty_max, static_cast<std::uint32_t>(parts.duty_steps));
  parts.gate.brake_rate_per_s = s.gate.brake_rate_per_s;
  parts.gate.brake_free_duty = s.model.brake.u0;
  return true;
}

}  // namespace abs_hil::study::lanes

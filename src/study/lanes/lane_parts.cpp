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

std::uint32_t cycles_of_window(const LaneSettings::Parts& parts, std::int32_t counts_per_rev) {
  const runtime::GateOptions& gate = parts.settings.gate;
  rig::RigParameters rig;
  rig.encoder_counts_per_rev = counts_per_rev;
  const runtime::SpeedWindows windows(runtime::plausibility_limits(rig, false, gate));
  const std::int64_t least_ns = std::max(runtime::least_speed_window_ns, windows.resolving_ns());
  const std::int64_t cycles = (least_ns + parts.period_ns - 1) / parts.period_ns;
  constexpr std::int64_t most_cycles = 64;
  const double lasts_s = static_cast<double>(cycles * parts.period_ns) * rig::s_per_ns;
  return cycles > most_cycles || lasts_s > gate.judge_within_s ? 0 : static_cast<std::uint32_t>(cycles);
}

LaneGate<double> plan_gate(const LaneSettings::Parts& parts, const rig::RigParameters& identity, std::uint32_t cycles) {
  const config::Settings& s = parts.settings;
  const runtime::PlausibilityLimits limits = runtime::plausibility_limits(identity, s.plant.ideal_actuator, s.gate);
  const runtime::SpeedWindows windows(limits);
  return {.watch = runtime::WheelWatch<double>(limits),
          .momentum = runtime::MomentumWatch<double>(limits),
          .upper = {limits.upper_gain_rad_s2, limits.upper_loss_rad_s2, limits.overspeed_rad_s},
          .lower = {limits.lower_gain_rad_s2, limits.lower_loss_rad_s2, limits.overspeed_rad_s},
          .brake = rig::BasicBrake<double>(identity.brake),
          .rad_per_count = limits.rad_per_count,
          .sure_counts = static_cast<double>(windows.sure_counts()),
          .window_s = static_cast<double>(cycles * parts.period_ns) * rig::s_per_ns,
          .overspeed_rad_s = limits.overspeed_rad_s,
          .brake_duty_max = rig::duty_at_most(s.gate.brake_duty_max, static_cast<std::uint32_t>(parts.duty_steps)),
          .brake_rate_per_s = s.gate.brake_rate_per_s,
          .brake_free_duty = identity.brake.u0};
}

}  // namespace abs_hil::study::lanes

#include "abs_hil/experiment/experiments.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

namespace abs_hil::experiment {

namespace {

/// Slack on the time limit of phases that end by their duration.
constexpr double duration_slack_s = 1.0;

/// The paper's experiment (section 4): accelerate; when the maximal speed of the upper wheel is detected, cut the motor
/// and brake under slip control; below the least speed for it hold the brake until both wheels stand.
std::vector<PhasePlan> plan_paper(const ExperimentOptions& o, double v_min_m_s) {
  using rig::Phase;
  using rig::Reason;
  std::vector<PhasePlan> plans;
  if (o.start_speed_rad_s <= 0.0) {
    plans.push_back({.phase = Phase::idle,
                     .ends_on = {{EndKind::duration, o.idle_s, Reason::phase_duration_over}},
                     .time_limit_s = o.idle_s + duration_slack_s});
    const EndCondition cut =
        o.cut == "peak" ? EndCondition{EndKind::upper_wheel_peak, o.peak_wait_s, Reason::upper_wheel_peak_detected}
                        : EndCondition{EndKind::upper_speed_above, o.cut_speed_rad_s, Reason::speed_threshold_reached};
    plans.push_back({.phase = Phase::accelerate,
                     .motor_duty = o.motor_duty,
                     .ends_on = {cut},
                     .time_limit_s = o.accelerate_limit_s});
    plans.push_back({.phase = Phase::coast,
                     .ends_on = {{EndKind::duration, o.coast_s, Reason::phase_duration_over}},
                     .time_limit_s = o.coast_s + duration_slack_s});
  }
  const bool speed_first = o.end_speed_m_s >= v_min_m_s;
  plans.push_back({.phase = Phase::brake,
                   .brake = BrakeAction::slip_control,
                   .ends_on = {{EndKind::car_speed_below, std::max(o.end_speed_m_s, v_min_m_s),
                                speed_first ? Reason::end_speed_reached : Reason::slip_control_left_at_low_speed}},
                   .time_limit_s = o.brake_limit_s});
  plans.push_back({.phase = Phase::hold,
                   .brake = BrakeAction::torque,
                   .brake_torque_Nm = o.hold_torque_Nm,
                   .ends_on = {{EndKind::standstill, 0.0, Reason::standstill_reached}},
                   .time_limit_s = o.hold_limit_s});
  plans.push_back({.phase = Phase::stopped,
                   .ends_on = {{EndKind::duration, o.stopped_s, Reason::sequence_complete}},
                   .time_limit_s = o.stopped_s + duration_slack_s});
  return plans;
}

/// Grip that falls to 12 / 23 for 0.4 s in mid-braking: on paper-table1 theta goes 23, 12, 23 N. Early enough to be
/// over above 3 m/s on every plant.
constexpr std::string_view half_grip = "braking time: 1; 0.521739 at 0.6; 1 at 1";

constexpr std::array<ExperimentEntry, 2> entries{{
    {"paper", "start, accelerate, cut the motor at the upper wheel's maximum, brake under slip control to a stop",
     plan_paper},
    {"friction-jump", "as paper, with grip that falls to 12/23 from 0.6 s to 1 s of braking (simulation only)",
     plan_paper, half_grip},
}};

}  // namespace

std::span<const ExperimentEntry> experiments() noexcept { return entries; }

std::string_view friction_profile_of(std::string_view experiment) noexcept {
  for (const ExperimentEntry& entry : entries) {
    if (entry.name == experiment) return entry.friction_profile;
  }
  return {};
}

std::vector<PhasePlan> plan_experiment(const ExperimentOptions& options, double v_min_m_s) {
  std::string known;
  for (const ExperimentEntry& entry : entries) {
    if (entry.name == options.name) return entry.plan(options, v_min_m_s);
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  throw std::invalid_argument("unknown experiment \"" + options.name + "\"; known: " + known);
}

}  // namespace abs_hil::experiment

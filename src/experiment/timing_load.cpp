#include "experiment/timing_load.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace abs_hil::experiment {

namespace {

constexpr double longest_s = 86'400.0;
constexpr double accelerate_s = 1.0;
constexpr double brake_s = 0.3;

PhasePlan timed(rig::Phase phase, double duration_s) {
  constexpr double slack_s = 1.0;
  return {.phase = phase,
          .ends_on = {{EndKind::duration, duration_s, rig::Reason::phase_duration_over}},
          .time_limit_s = duration_s + slack_s};
}

}  // namespace

std::vector<PhasePlan> plan_timing_load(double duration_s) {
  if (!(duration_s > 0.0 && duration_s <= longest_s)) {
    throw std::invalid_argument("duration " + std::to_string(duration_s) + " s: give a time in (0, 86400] s");
  }
  std::vector<PhasePlan> plans;
  for (double left_s = duration_s; left_s > 0.0;) {
    PhasePlan accelerate = timed(rig::Phase::accelerate, std::min(accelerate_s, left_s));
    accelerate.motor_duty = 1.0;
    plans.push_back(accelerate);
    left_s -= accelerate_s;
    if (left_s <= 0.0) break;
    PhasePlan brake = timed(rig::Phase::brake, std::min(brake_s, left_s));
    brake.brake = BrakeAction::slip_control;
    plans.push_back(brake);
    left_s -= brake_s;
  }
  return plans;
}

}  // namespace abs_hil::experiment

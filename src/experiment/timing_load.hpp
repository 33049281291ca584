#pragma once

#include <vector>

#include "experiment/sequence.hpp"

namespace abs_hil::experiment {

/// Speed of both wheels to start from: high enough that the wheels never come near standstill, where the simulation
/// takes so many small steps that reading it would hide the machine's own lateness.
inline constexpr double timing_load_start_speed_rad_s = 50.0;

/// Phases that keep a cycle as busy as an experiment does, for `abs_hil latency`: accelerating and braking under slip
/// control by turns, for `duration_s` in all, with the brake released at the end. The simulated rig only: nothing waits
/// for a speed. Throws std::invalid_argument unless 0 < duration_s <= 86400.
[[nodiscard]] std::vector<PhasePlan> plan_timing_load(double duration_s);

}  // namespace abs_hil::experiment

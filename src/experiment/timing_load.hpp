#pragma once

#include <vector>

#include "experiment/sequence.hpp"

namespace abs_hil::experiment {

/// Initial speed of both wheels. It keeps the wheels far from standstill: there the simulation takes so many small
/// steps that its cost would hide the computer's own latency.
inline constexpr double timing_load_start_speed_rad_s = 50.0;

/// Phases that load a cycle as an experiment does, for `abs_hil latency`. They alternate acceleration and braking under
/// slip control, last `duration_s` in all, and end with the brake released. For the simulated rig only: no phase waits
/// for a speed. Throws std::invalid_argument unless 0 < duration_s <= 86400.
[[nodiscard]] std::vector<PhasePlan> plan_timing_load(double duration_s);

}  // namespace abs_hil::experiment

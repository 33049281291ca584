#pragma once

#include <vector>

#include "abs_hil/experiment/sequence.hpp"

namespace abs_hil::experiment {

/// Phases that keep a cycle as busy as an experiment does, for `abs_hil latency`: accelerating and braking under slip
/// control by turns, for `duration_s` in all, with the brake released at the end. The simulated rig only: nothing waits
/// for a speed. Throws std::invalid_argument unless 0 < duration_s <= 86400.
[[nodiscard]] std::vector<PhasePlan> plan_timing_load(double duration_s);

}  // namespace abs_hil::experiment

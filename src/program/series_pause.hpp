#pragma once

#include "abs_hil/rig/reason.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

/// Waits in real time between two runs of a series, so that the brake cools. A signal or a `stop` on the LCM network of
/// `run` (not with --no-lcm) ends the wait. A stop is answered as during a run.
/// @param run  the run that has ended
/// @return the reason to end the series; `none` after the whole pause
/// Throws telemetry::LcmError without a network.
[[nodiscard]] rig::Reason pause_between_runs(const RunRequest& run, double duration_s);

}  // namespace abs_hil::program

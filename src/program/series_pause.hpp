#pragma once

#include "abs_hil/rig/reason.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

/// Waits between two runs of a series, in real time: the brake cools. A signal, or a `stop` on the LCM network of
/// `run` (none with --no-lcm), ends it; a stop is answered as a run would answer it.
/// @param run  the run that has ended
/// @return who wants the series to end; `none` after the whole pause
/// Throws telemetry::LcmError without a network.
[[nodiscard]] rig::Reason pause_between_runs(const RunRequest& run, double duration_s);

}  // namespace abs_hil::program

#pragma once

#include "abs_hil/rig/overrun_cause.hpp"
#include "rig/duration_quantiles.hpp"

namespace abs_hil::rig {

/// Timing of a run without its start-up cycles.
struct TimingSummary {
  DurationQuantiles wakeup_latency{};  ///< lateness of the wake-up against its tick
  DurationQuantiles read{};
  DurationQuantiles control{};  ///< estimate, sequence, control, gate
  DurationQuantiles write{};
  DurationQuantiles cycle_time{};  ///< wake-up to end of write
  OverrunCounts overruns{};
};

}  // namespace abs_hil::rig

#pragma once

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/overrun_cause.hpp"

namespace abs_hil::rig {

/// Quantiles of a duration, us. NaN while there are none.
struct DurationQuantiles {
  double p50_us{unknown};
  double p99_us{unknown};
  double p99_9_us{unknown};
  double max_us{unknown};
};

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

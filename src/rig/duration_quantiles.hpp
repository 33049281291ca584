#pragma once

#include "abs_hil/rig/measurement.hpp"

namespace abs_hil::rig {

/// Quantiles of a duration, us. NaN while there are none.
struct DurationQuantiles {
  double p50_us{unknown};
  double p99_us{unknown};
  double p99_9_us{unknown};
  double max_us{unknown};
};

}  // namespace abs_hil::rig

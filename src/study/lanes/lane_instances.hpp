// The kernels of one instruction set.
#pragma once

// The kernels of one instruction set. A source defines ABS_HIL_LANE_ISA and ABS_HIL_LANE_VECTORS and includes this; it
// is compiled for that set alone, so it must define no function that other sources define too: tests/study/lanes checks
// the names.
#include "study/lanes/lane_engine.hpp"
#include "study/lanes/lane_kinds.hpp"

namespace abs_hil::study::lanes {

#define ABS_HIL_LANE_KERNEL(law, tyre, load)                                            \
  template <>                                                                           \
  LaneKernel lane_kernel<rig::ABS_HIL_LANE_ISA, LaneKind<law, tyre, load>>() noexcept { \
    return &run_in_lanes<rig::ABS_HIL_LANE_ISA, ABS_HIL_LANE_VECTORS, law, tyre, load>; \
  }
ABS_HIL_LANE_KINDS(ABS_HIL_LANE_KERNEL)
#undef ABS_HIL_LANE_KERNEL

}  // namespace abs_hil::study::lanes

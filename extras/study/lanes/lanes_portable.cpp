// Runs in lanes, compiled for this instruction set alone.
#define ABS_HIL_LANE_ISA Portable
#define ABS_HIL_LANE_VECTORS 2
#include "study/lanes/lane_engine.hpp"

// Runs in lanes, compiled for this instruction set alone.
#define ABS_HIL_LANE_ISA Avx512
#define ABS_HIL_LANE_VECTORS 2
#include "study/lanes/lane_engine.hpp"

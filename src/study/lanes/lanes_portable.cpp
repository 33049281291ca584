#define ABS_HIL_LANE_ISA Portable
#define ABS_HIL_LANE_VECTORS 2
#include "study/lanes/lane_instances.hpp"

// As many lanes as a fit has columns: states, parameters and the undisturbed window.
#define ABS_HIL_LANE_ISA Avx2
#define ABS_HIL_LANE_VECTORS 6
#include "lanes/lane_plant.hpp"

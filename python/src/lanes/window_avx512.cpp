// As many lanes as a fit has columns: states, parameters and the undisturbed window.
#define ABS_HIL_LANE_ISA Avx512
#define ABS_HIL_LANE_VECTORS 3
#include "lanes/lane_plant.hpp"

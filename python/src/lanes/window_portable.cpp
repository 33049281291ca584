// As many lanes as a fit has columns: states, parameters and the undisturbed window.
#define ABS_HIL_LANE_ISA Portable
#define ABS_HIL_LANE_VECTORS 4
#include "lanes/lane_plant.hpp"

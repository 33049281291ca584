#include "abs_hil/plant_sim/options.hpp"

#include <cmath>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::plant_sim {

void check(const PlantOptions& options) {
  PlantOptions checked = options;
  // Steps coarser than the configuration allows show the order of the integration.
  if (options.max_step_s > 0.0 && std::isfinite(options.max_step_s)) checked.max_step_s = PlantOptions{}.max_step_s;
  rig::require_valid(checked, "plant.");
}

}  // namespace abs_hil::plant_sim

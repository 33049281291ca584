#pragma once

#include "abs_hil/plant_sim/plant.hpp"

// Rigs for tests: Table 1 with parts of the physics taken away.
namespace abs_hil::plant_sim {

/// The wheels do not touch, except for a force that changes speeds by at most 1e-10 rad/s per second.
inline PlantOptions wheels_apart() {
  PlantOptions options;
  options.rig.tyre.theta_N = 1e-12;
  return options;
}

/// No bearing friction at all.
inline PlantOptions frictionless() {
  PlantOptions options;
  options.rig.wheels.d1_Nms_rad = options.rig.wheels.d2_Nms_rad = 0.0;
  options.rig.wheels.M10_Nm = options.rig.wheels.M20_Nm = 0.0;
  return options;
}

/// The maker's model (config/plants/inteco-manual.toml).
inline PlantOptions inteco_manual() {
  PlantOptions options;
  options.rig.wheels.J1_kg_m2 = 7.53e-3;
  options.rig.tyre = {34.31, 19.49, 1.2694};
  options.tyre = "inteco-mu";
  options.load = "lever";
  return options;
}

/// Both wheels at the same speed, the start of the paper's braking.
inline constexpr PlantState rolling_at_170{.omega1_rad_s = 170.0, .omega2_rad_s = 170.0};

}  // namespace abs_hil::plant_sim

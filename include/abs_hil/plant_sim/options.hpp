#pragma once

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::plant_sim {

/// The simulated rig. `rig` holds its true parameters.
struct PlantOptions {
  rig::RigParameters rig{};
  bool ideal_actuator{false};            ///< the torque asked for acts at once, without map, lag and saturation
  bool ideal_sensors{false};             ///< measurements carry the true speeds
  double slip_regularisation_m_s{0.02};  ///< (5) divides by at least this car speed, > 0
  double max_step_s{500e-6};             ///< largest integration step, > 0; a test shows the error at the default
};

/// Throws std::invalid_argument, naming the configuration key, its value and its range, if an option is outside it.
void check(const PlantOptions& options);

}  // namespace abs_hil::plant_sim

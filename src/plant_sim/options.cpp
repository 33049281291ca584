// Checks of the plant's options, and what limits must know of a plant.
#include "abs_hil/plant_sim/options.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <variant>

#include "abs_hil/plant_sim/tyre_models.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::plant_sim {

rig::RigParameters identity_of(const PlantOptions& options) {
  rig::RigParameters rig = options.rig;
  if (options.load != "lever") return rig;
  // As the plants' files do, theta_N lies between the forces with released and with full brake. The limits' factor of 2
  // covers the latter: it may be 1.5 times as large, when the brake presses the wheels together.
  constexpr double part_of_most = 0.75;
  const LeverParameters& lever = options.lever;
  const double mu = std::visit([](const auto& tyre) { return tyre.peak_mu(); }, make_tyre_model(options));
  const double phi_rad = lever.phi_deg * std::numbers::pi / 180.0;
  const double arm_m = lever.L_m * (std::sin(phi_rad) - mu * std::cos(phi_rad));
  const double pressing_Nm = lever.Mg_Nm + ::abs_hil::rig::brake_torque_at(rig.brake, 1.0) + rig.wheels.M10_Nm;
  rig.tyre.theta_N = std::max(rig.tyre.theta_N, part_of_most * mu * pressing_Nm / arm_m);
  return rig;
}

void check(const PlantOptions& options) {
  PlantOptions checked = options;
  // Steps coarser than the configuration allows show the order of the integration.
  if (options.max_step_s > 0.0 && std::isfinite(options.max_step_s)) checked.max_step_s = PlantOptions{}.max_step_s;
  rig::require_valid(checked, "plant.");
}

}  // namespace abs_hil::plant_sim

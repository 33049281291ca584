#include "abs_hil/plant_sim/load_models.hpp"

#include <numbers>
#include <stdexcept>
#include <string>

namespace abs_hil::plant_sim {
namespace {

/// Friction must leave at least this share of the lever's arm L sin phi; below it the normal force would increase more
/// than tenfold.
constexpr double least_arm = 0.1;

}  // namespace

template <class S>
BasicLeverLoad<S>::BasicLeverLoad(const PlantOptions& options, double peak_mu, double friction_at_most)
  requires std::is_same_v<S, double>
    : peak_mu_(peak_mu),
      r1_m_(options.rig.wheels.r1_m),
      Mg_Nm_(options.lever.Mg_Nm),
      L_sin_phi_m_(options.lever.L_m * std::sin(options.lever.phi_deg * std::numbers::pi / 180.0)),
      L_cos_phi_m_(options.lever.L_m * std::cos(options.lever.phi_deg * std::numbers::pi / 180.0)) {
  const double most_mu = (1.0 - least_arm) * L_sin_phi_m_ / wedging_m(UpperWheelTorques<S, double>{});
  if (peak_mu * friction_at_most <= most_mu) return;
  throw std::invalid_argument("plant.load = \"lever\": a friction coefficient of " +
                              std::to_string(peak_mu * friction_at_most) +
                              " would wedge the wheel under its lever; it can be at most " + std::to_string(most_mu) +
                              " with this plant.lever_L_m, plant.lever_phi_deg and plant.r1_m");
}

template class BasicLeverLoad<double>;

LoadModel make_load_model(const PlantOptions& options, double peak_mu, double friction_at_most) {
  if (options.load == "constant") return ConstantLoad(options);
  if (options.load == "lever") return LeverLoad(options, peak_mu, friction_at_most);
  throw std::invalid_argument("plant.load = \"" + options.load + "\": give constant or lever");
}

}  // namespace abs_hil::plant_sim

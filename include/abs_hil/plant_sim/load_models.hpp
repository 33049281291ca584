#pragma once

#include <algorithm>
#include <cmath>
#include <variant>

#include "abs_hil/plant_sim/options.hpp"

// Models of the force that presses the wheels together. Each converts the friction coefficient relative to the tyre's
// peak ("shape": the tyre's value times the profile's friction) into the tyre force. All functions are real-time safe
// except for the constructors.
namespace abs_hil::plant_sim {

/// Torques between the upper wheel and the frame that carries it.
struct UpperWheelTorques {
  double sliding{0.0};     ///< direction of sliding in bearing and brake: +1, -1, or 0 if they hold the wheel
  double dry_Nm{0.0};      ///< bearing and brake torque that acts, or can act at most if they hold it: M10 + Tb
  double viscous_Nm{0.0};  ///< d1 omega1
};

/// The paper's load (4): constant, so the tyre force peaks at theta = mu D.
class ConstantLoad {
 public:
  explicit ConstantLoad(const PlantOptions& options) noexcept : theta_N_(options.rig.tyre.theta_N) {}

  [[nodiscard]] double force_N(double shape, const UpperWheelTorques& /*torques*/) const noexcept {
    return theta_N_ * shape;
  }
  /// Upper bound on the slope of `force_N` over `shape` while the latter stays within `most_shape`, N.
  [[nodiscard]] double steepest_N(double /*most_shape*/, const UpperWheelTorques& /*torques*/) const noexcept {
    return theta_N_;
  }

 private:
  double theta_N_;
};

/// The maker's load. The upper wheel sits on a lever; the torques on the wheel press it down in braking,
///   Fn = (Mg + s1 M1 + s1 M10 + d1 omega1) / (L (sin phi - s mu cos phi)),
/// and lift it in traction. A wheel that its brake holds transmits only the tyre's torque r1 F, whatever the brake
/// could hold: s1 (M1 + M10) = r1 F. Where Fn would be negative, the wheel lifts off and transmits no force.
class LeverLoad {
 public:
  /// @param peak_mu            highest friction coefficient of the tyre
  /// @param friction_at_most   highest value of the friction profile
  /// Throws std::invalid_argument if this friction would wedge the lever.
  LeverLoad(const PlantOptions& options, double peak_mu, double friction_at_most);

  [[nodiscard]] double force_N(double shape, const UpperWheelTorques& torques) const noexcept {
    const double mu = peak_mu_ * shape;
    return mu * pressing_Nm(torques) / (L_sin_phi_m_ - mu * wedging_m(torques));
  }
  [[nodiscard]] double steepest_N(double most_shape, const UpperWheelTorques& torques) const noexcept {
    const double arm_m = L_sin_phi_m_ - peak_mu_ * most_shape * wedging_m(torques);
    return peak_mu_ * pressing_Nm(torques) * L_sin_phi_m_ / (arm_m * arm_m);
  }

 private:
  [[nodiscard]] double pressing_Nm(const UpperWheelTorques& torques) const noexcept {
    return std::max(0.0, Mg_Nm_ + torques.sliding * torques.dry_Nm + torques.viscous_Nm);
  }
  /// Reduction of the lever's arm per unit of friction, m.
  [[nodiscard]] double wedging_m(const UpperWheelTorques& torques) const noexcept {
    return torques.sliding == 0.0 ? L_cos_phi_m_ + r1_m_ : L_cos_phi_m_;
  }

  double peak_mu_;
  double r1_m_;
  double Mg_Nm_;
  double L_sin_phi_m_;
  double L_cos_phi_m_;
};

using LoadModel = std::variant<ConstantLoad, LeverLoad>;

/// Makes the model named `options.load`. Throws std::invalid_argument with the known names for an unknown one.
[[nodiscard]] LoadModel make_load_model(const PlantOptions& options, double peak_mu, double friction_at_most);

}  // namespace abs_hil::plant_sim

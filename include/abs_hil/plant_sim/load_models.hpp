#pragma once

#include <algorithm>
#include <cmath>
#include <variant>

#include "abs_hil/plant_sim/options.hpp"

// What presses the wheels on each other. Each load turns a friction coefficient over the tyre's peak ("shape", as the
// tyre gives it, times the profile's friction) into the tyre force. All but the constructors are real-time safe.
namespace abs_hil::plant_sim {

/// What the frame that carries the upper wheel feels of it.
struct UpperWheelTorques {
  double sliding{0.0};     ///< way the wheel slides in its bearing and brake: +1, -1, or 0 held by them
  double dry_Nm{0.0};      ///< bearing and brake torque that acts, or may act, on it: M10 + Tb
  double viscous_Nm{0.0};  ///< d1 omega1
};

/// The paper's load (4): constant, so the tyre force peaks at theta = mu D.
class ConstantLoad {
 public:
  explicit ConstantLoad(const PlantOptions& options) noexcept : theta_N_(options.rig.tyre.theta_N) {}

  [[nodiscard]] double force_N(double shape, const UpperWheelTorques& /*torques*/) const noexcept {
    return theta_N_ * shape;
  }
  /// What `force_N` rises by at most with `shape`, as long as that stays within `most_shape`, N.
  [[nodiscard]] double steepest_N(double /*most_shape*/, const UpperWheelTorques& /*torques*/) const noexcept {
    return theta_N_;
  }

 private:
  double theta_N_;
};

/// The maker's load: the upper wheel sits on a lever, which the torques on the wheel press down in braking,
///   Fn = (Mg + s1 M1 + s1 M10 + d1 omega1) / (L (sin phi - s mu cos phi)),
/// and lift in traction. A wheel that its brake holds hands on just the torque of the tyre, r1 F, whatever the brake
/// could hold: s1 (M1 + M10) = r1 F. Where Fn would fall below 0 the wheel lifts off and carries nothing.
class LeverLoad {
 public:
  /// @param peak_mu            the tyre's highest friction coefficient
  /// @param friction_at_most   highest value of the friction profile
  /// Throws std::invalid_argument if so much friction would wedge the lever.
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
  /// How much of the lever's arm a unit of friction takes away.
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

/// The one that `options.load` names. Throws std::invalid_argument, naming the known ones, for an unknown name.
[[nodiscard]] LoadModel make_load_model(const PlantOptions& options, double peak_mu, double friction_at_most);

}  // namespace abs_hil::plant_sim

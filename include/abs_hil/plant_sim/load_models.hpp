#pragma once

#include <algorithm>
#include <cmath>
#include <variant>

#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/scalar.hpp"

// Models of the force that presses the wheels together. Each converts the friction coefficient relative to the tyre's
// peak ("shape": the tyre's value) and the profile's friction into the tyre force. All functions are real-time safe
// except for the constructors.
namespace abs_hil::plant_sim {

/// A wheel that turns forwards: the direction of sliding +1, known when the program is compiled.
struct Forwards {
  template <class S>
  friend constexpr const S& operator*(Forwards, const S& x) noexcept {
    return x;
  }
  friend constexpr bool operator==(Forwards, double direction) noexcept { return direction == 1.0; }
};

/// A wheel that stands and that its brake holds: the direction of sliding 0.
struct Held {
  template <class S>
  friend constexpr S operator*(Held, const S& /*x*/) noexcept {
    return S(0.0);
  }
  friend constexpr bool operator==(Held, double direction) noexcept { return direction == 0.0; }
};

/// Torques between the upper wheel and the frame that carries it. `Direction` is `double`, `Forwards` or `Held`.
template <class S, class Direction>
struct UpperWheelTorques {
  Direction sliding{};  ///< direction of sliding in bearing and brake: +1, -1, or 0 if they hold the wheel
  S dry_Nm{0.0};        ///< bearing and brake torque that acts, or can act at most if they hold it: M10 + Tb
  S viscous_Nm{0.0};    ///< d1 omega1
};

/// The paper's load (4): constant, so the tyre force peaks at theta = mu D.
template <class S>
class BasicConstantLoad {
 public:
  static constexpr bool knows_sliding = false;  ///< the force depends on UpperWheelTorques::sliding

  BasicConstantLoad() = default;
  explicit BasicConstantLoad(const PlantOptions& options) noexcept : theta_N_(options.rig.tyre.theta_N) {}

  template <class Direction>
  [[nodiscard]] S force_N(const S& friction, const S& shape,
                          const UpperWheelTorques<S, Direction>& /*torques*/) const noexcept {
    return theta_N_ * friction * shape;
  }
  /// Upper bound on the slope of `force_N` over friction times `shape` while this stays within `most_shape`, N.
  template <class Direction>
  [[nodiscard]] S steepest_N(const S& /*most_shape*/,
                             const UpperWheelTorques<S, Direction>& /*torques*/) const noexcept {
    return theta_N_;
  }

 private:
  S theta_N_{0.0};
};
using ConstantLoad = BasicConstantLoad<double>;

/// The maker's load. The upper wheel sits on a lever; the torques on the wheel press it down in braking,
///   Fn = (Mg + s1 M1 + s1 M10 + d1 omega1) / (L (sin phi - s mu cos phi)),
/// and lift it in traction. A wheel that its brake holds transmits only the tyre's torque r1 F, whatever the brake
/// could hold: s1 (M1 + M10) = r1 F. Where Fn would be negative, the wheel lifts off and transmits no force.
template <class S>
class BasicLeverLoad {
 public:
  static constexpr bool knows_sliding = true;

  BasicLeverLoad() = default;
  /// @param peak_mu            highest friction coefficient of the tyre
  /// @param friction_at_most   highest value of the friction profile
  /// Throws std::invalid_argument if this friction would wedge the lever.
  BasicLeverLoad(const PlantOptions& options, double peak_mu, double friction_at_most);

  template <class Direction>
  [[nodiscard]] S force_N(const S& friction, const S& shape,
                          const UpperWheelTorques<S, Direction>& torques) const noexcept {
    const S mu = peak_mu_ * friction * shape;
    return mu * pressing_Nm(torques) / (L_sin_phi_m_ - mu * wedging_m(torques));
  }
  template <class Direction>
  [[nodiscard]] S steepest_N(const S& most_shape, const UpperWheelTorques<S, Direction>& torques) const noexcept {
    const S arm_m = L_sin_phi_m_ - peak_mu_ * most_shape * wedging_m(torques);
    return peak_mu_ * pressing_Nm(torques) * L_sin_phi_m_ / (arm_m * arm_m);
  }

 private:
  template <class Direction>
  [[nodiscard]] S pressing_Nm(const UpperWheelTorques<S, Direction>& torques) const noexcept {
    return rig::larger(S(0.0), Mg_Nm_ + torques.sliding * torques.dry_Nm + torques.viscous_Nm);
  }
  /// Reduction of the lever's arm per unit of friction, m.
  template <class Direction>
  [[nodiscard]] S wedging_m(const UpperWheelTorques<S, Direction>& torques) const noexcept {
    return torques.sliding == 0.0 ? L_cos_phi_m_ + r1_m_ : L_cos_phi_m_;
  }

  S peak_mu_{0.0};
  S r1_m_{0.0};
  S Mg_Nm_{0.0};
  S L_sin_phi_m_{0.0};
  S L_cos_phi_m_{0.0};
};
using LeverLoad = BasicLeverLoad<double>;

using LoadModel = std::variant<ConstantLoad, LeverLoad>;

/// Makes the model named `options.load`. Throws std::invalid_argument with the known names for an unknown one.
[[nodiscard]] LoadModel make_load_model(const PlantOptions& options, double peak_mu, double friction_at_most);

}  // namespace abs_hil::plant_sim

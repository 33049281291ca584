#pragma once

#include "abs_hil/plant_sim/load_models.hpp"
#include "abs_hil/plant_sim/tyre_models.hpp"
#include "abs_hil/rig/state_bytes.hpp"

namespace abs_hil::plant_sim {

/// The variables of the tyre force at one instant.
struct ContactState {
  double omega1_rad_s{0.0};
  double omega2_rad_s{0.0};
  double brake_torque_Nm{0.0};
  double upper_sliding{0.0};  ///< the upper wheel's sliding in bearing and brake: +1, -1, or 0 if they hold it
  double friction{1.0};       ///< friction of the road at the contact relative to the tyre model
};

/// Two wheels: their parameters, a tyre model and a load model. They are in contact until they are parted. Real-time
/// safe except for the constructor.
class WheelModel {
 public:
  /// Throws std::invalid_argument for an unknown or impossible model.
  /// @param friction_at_most  highest value of the friction profile
  WheelModel(const PlantOptions& options, double friction_at_most)
      : wheels_(options.rig.wheels),
        tyre_(make_tyre_model(options)),
        load_(make_load_model(options, std::visit([](const auto& tyre) { return tyre.peak_mu(); }, tyre_),
                              friction_at_most)) {}

  [[nodiscard]] const rig::WheelParameters& wheels() const noexcept { return wheels_; }
  /// Replaces the wheel parameters, for drifted bearings.
  void set_wheels(const rig::WheelParameters& wheels) noexcept { wheels_ = wheels; }

  /// Parts the wheels, or joins them again. Wheels apart exchange no force.
  void part(bool apart) noexcept { apart_ = apart; }

  /// Slip by the tyre model's definition, positive in braking.
  [[nodiscard]] double slip(double omega1_rad_s, double omega2_rad_s) const noexcept {
    return std::visit(
        [&](const auto& tyre) { return tyre.slip(wheels_.r1_m * omega1_rad_s, wheels_.r2_m * omega2_rad_s); }, tyre_);
  }

  /// Tyre force, N; positive if it drives the upper wheel forward and brakes the lower one.
  [[nodiscard]] double tyre_force_N(const ContactState& c) const noexcept {
    const double shape = std::visit(
        [&](const auto& tyre) { return tyre.shape_at(wheels_.r1_m * c.omega1_rad_s, wheels_.r2_m * c.omega2_rad_s); },
        tyre_);
    return force_N(shape, c);
  }

  /// The largest braking force that any slip could give now, N: theta of (10). With the lever it increases with the
  /// torques on the upper wheel, and holds for the present torques.
  [[nodiscard]] double peak_force_N(const ContactState& c) const noexcept { return force_N(1.0, c); }

  /// Upper bound on the slope of the tyre force over the difference of the circumferential speeds, N s/m, at any slip.
  /// It bounds the stiffness of the slip dynamics.
  [[nodiscard]] double damping_bound_Ns_m(const ContactState& c) const noexcept {
    if (apart_) return 0.0;
    const double steepest_s_m = std::visit(
        [&](const auto& tyre) {
          return tyre.steepest_s_m(wheels_.r1_m * c.omega1_rad_s, wheels_.r2_m * c.omega2_rad_s);
        },
        tyre_);
    const Torques torques = upper_torques(c);
    return std::visit([&](const auto& load) { return load.steepest_N(c.friction, torques); }, load_) * c.friction *
           steepest_s_m;
  }

  /// Calls `visitor` with the tyre model and the load model as their own types.
  template <class Visitor>
  auto visit(Visitor&& visitor) const {
    return std::visit(visitor, tyre_, load_);
  }
  [[nodiscard]] bool apart() const noexcept { return apart_; }
  void exchange_state(rig::StateBytes& state) { state(wheels_, apart_); }

 private:
  using Torques = UpperWheelTorques<double, double>;

  [[nodiscard]] Torques upper_torques(const ContactState& c) const noexcept {
    return {c.upper_sliding, wheels_.M10_Nm + c.brake_torque_Nm, wheels_.d1_Nms_rad * c.omega1_rad_s};
  }
  [[nodiscard]] double force_N(double shape, const ContactState& c) const noexcept {
    if (apart_) return 0.0;
    const Torques torques = upper_torques(c);
    return std::visit([&](const auto& load) { return load.force_N(c.friction, shape, torques); }, load_);
  }

  rig::WheelParameters wheels_;
  TyreModel tyre_;
  LoadModel load_;
  bool apart_{false};
};

}  // namespace abs_hil::plant_sim

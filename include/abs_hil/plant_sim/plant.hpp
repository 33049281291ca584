// The simulated rig: wheels, tyre, brake, motor and encoders, advanced step by step.
#pragma once

#include <cstdint>
#include <optional>

#include "abs_hil/plant_sim/drift.hpp"
#include "abs_hil/plant_sim/load_models.hpp"
#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/plant_sim/tyre_models.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/measurement.hpp"
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

/// Inputs of the plant, constant during `advance`.
struct PlantInput {
  double motor_duty{0.0};       ///< in [0, 1]
  double brake_duty{0.0};       ///< in [0, 1]
  double brake_torque_Nm{0.0};  ///< applied directly if `ideal_actuator`, else ignored
};

/// State of the plant. Angles increase at positive speeds.
struct PlantState {
  double angle1_rad{0.0};
  double angle2_rad{0.0};
  double omega1_rad_s{0.0};
  double omega2_rad_s{0.0};
  double brake_torque_Nm{0.0};
};

/// What road and drift make of the rig now, and for how long.
struct PlantConditions {
  double friction{1.0};              ///< value of the friction profile
  double brake_torque{1.0};          ///< drift of the brake torque
  rig::WheelParameters wheels{};     ///< with the drift of their bearings
  double steady_s{0.0};              ///< how long all of it stays so; 0 while it changes, or until the brake is applied
  double steady_to_angle2_rad{0.0};  ///< the lower wheel's angle up to which it stays so
};

/// The rig's mechanics (1)-(11) with the corrections of docs/theory.md: odd tyre force; set-valued Coulomb friction (a
/// standing wheel stays at exactly 0 until the torques on it exceed its friction); brake lag and map; drive motor with
/// back-EMF. It includes one of several tyre and load models, a road with changing friction, drifting parameters, and
/// the flaws of a real brake (docs/plants.md). Deterministic; `advance` does not allocate or throw.
class Plant {
 public:
  /// Throws std::invalid_argument if an option is outside its range.
  explicit Plant(const PlantOptions& options);

  /// Sets the state, joins the wheels and returns every profile to its start.
  void reset(const PlantState& state) noexcept;
  /// Advances the plant by `duration_s` >= 0 under `input`.
  void advance(double duration_s, const PlantInput& input) noexcept;

  [[nodiscard]] PlantConditions conditions() const noexcept;
  /// Takes over a state that somebody else computed: `cycles` times `cycle_s` in which the conditions stayed as they
  /// were.
  void take_over(const PlantState& state, double cycle_s, std::int64_t cycles) noexcept;

  /// All of the state, the profiles' places and the brake's path included.
  void exchange_state(rig::StateBytes& state);

  /// Scales the road's friction from now on, on top of its profile: (0, 1], as the models were checked for 1.
  void scale_friction(double factor) noexcept { profile_.scale(factor); }

  /// Lifts the upper wheel off the lower one, which takes the tyre force away, or lowers it again.
  void part_wheels(bool apart) noexcept { model_.part(apart); }

  [[nodiscard]] const PlantState& state() const noexcept { return state_; }
  [[nodiscard]] double slip() const noexcept;
  [[nodiscard]] double tyre_force_N() const noexcept;
  /// Present value of the scaled friction profile: friction of the road relative to the tyre model.
  [[nodiscard]] double friction() const noexcept;
  /// `theta_N` is the largest braking force that any slip could give now (WheelModel::peak_force_N).
  [[nodiscard]] rig::PlantTruth truth() const noexcept;
  [[nodiscard]] const PlantOptions& options() const noexcept { return options_; }

 private:
  [[nodiscard]] ContactState contact() const noexcept;
  void let_bearings_drift(const DriftFactors& factors) noexcept;
  template <class Torques, class State, class GoOn>
  void advance_in_parts(const Torques& held, double duration_s, const PlantInput& input, const State& x,
                        const GoOn& go_on) noexcept;
  [[nodiscard]] bool switches_resistors() const noexcept {
    return options_.rig.motor.start_until_rad_s > 0.0 || options_.rig.motor.middle_until_rad_s > 0.0;
  }

  PlantOptions options_;
  FactorProgress profile_;
  Drift drift_;
  WheelModel model_;
  PlantState state_{};
  std::optional<BrakePath> brake_path_{};  ///< none: the brake has none of the flaws
};

}  // namespace abs_hil::plant_sim

#pragma once

#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/measurement.hpp"

namespace abs_hil::plant_sim {

/// Held inputs of the plant.
struct PlantInput {
  double motor_duty{0.0};       ///< in [0, 1]
  double brake_duty{0.0};       ///< in [0, 1]
  double brake_torque_Nm{0.0};  ///< applied directly if `ideal_actuator`, else ignored
};

/// State of the plant. Angles count up for positive speeds.
struct PlantState {
  double angle1_rad{0.0};
  double angle2_rad{0.0};
  double omega1_rad_s{0.0};
  double omega2_rad_s{0.0};
  double brake_torque_Nm{0.0};
};

/// The paper's plant (1)-(11) with the corrections of docs/theory.md: odd tyre force, set-valued Coulomb friction (a
/// wheel that stands stays at exactly 0 until the torques on it exceed its friction), brake lag and map, drive motor
/// with back-EMF. Deterministic; `advance` allocates nothing and does not throw.
class Plant {
 public:
  /// Throws std::invalid_argument if an option is outside its range.
  explicit Plant(const PlantOptions& options);

  void reset(const PlantState& state) noexcept;
  /// Lets `duration_s` >= 0 pass under `input`.
  void advance(double duration_s, const PlantInput& input) noexcept;

  [[nodiscard]] const PlantState& state() const noexcept { return state_; }
  [[nodiscard]] double slip() const noexcept;
  [[nodiscard]] double tyre_force_N() const noexcept;
  [[nodiscard]] rig::PlantTruth truth() const noexcept;
  [[nodiscard]] const PlantOptions& options() const noexcept { return options_; }

 private:
  PlantOptions options_;
  PlantState state_{};
};

}  // namespace abs_hil::plant_sim

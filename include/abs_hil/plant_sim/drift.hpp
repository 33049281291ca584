#pragma once

#include "abs_hil/plant_sim/factor_progress.hpp"
#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::plant_sim {

/// Factors of the drifting parameters at one instant.
struct DriftFactors {
  double brake_torque{1.0};
  double motor_torque{1.0};
  double upper_bearing{1.0};
  double lower_bearing{1.0};
};

/// A plant's position in the profiles of its drifting parameters. Real-time safe except for the constructor.
class Drift {
 public:
  /// Throws std::invalid_argument with the configuration key for an unusable profile.
  explicit Drift(const DriftProfiles& profiles);

  /// False if every factor is always 1; then the calls below are unnecessary.
  [[nodiscard]] bool any() const noexcept { return any_; }
  /// Returns to the start.
  void start() noexcept;
  /// Call when the brake acts. The first call sets the origin of profiles that count from braking.
  void brake_applied() noexcept;
  /// Length of the next part that may use the factors at its middle: `left_s` > 0, but only up to the next end of a
  /// profile's piece, and at most `max_step_s` while a factor changes.
  [[nodiscard]] double part_s(double left_s, double max_step_s) const noexcept;
  /// Advances the time by at most one part.
  void pass(double duration_s) noexcept;
  /// How long all factors stay as they are, as FactorProgress::steady_s.
  [[nodiscard]] double steady_s() const noexcept;
  /// The factors `time_s` from now, within a part.
  [[nodiscard]] DriftFactors after(double time_s) const noexcept;

  void exchange_state(rig::StateBytes& state) {
    for (FactorProgress* factor : {&brake_torque_, &motor_torque_, &upper_bearing_, &lower_bearing_}) {
      factor->exchange_state(state);
    }
  }

 private:
  FactorProgress brake_torque_;
  FactorProgress motor_torque_;
  FactorProgress upper_bearing_;
  FactorProgress lower_bearing_;
  bool any_;
};

}  // namespace abs_hil::plant_sim

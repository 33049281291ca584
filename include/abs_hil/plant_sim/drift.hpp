#pragma once

#include "abs_hil/plant_sim/factor_progress.hpp"
#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::plant_sim {

/// Factors over what drifts, at one instant.
struct DriftFactors {
  double brake_torque{1.0};
  double motor_torque{1.0};
  double upper_bearing{1.0};
  double lower_bearing{1.0};
};

/// How far a plant has come along the profiles of its drifting parts. Real-time safe but for the constructor.
class Drift {
 public:
  /// Throws std::invalid_argument, naming the configuration key, for a profile that cannot be used.
  explicit Drift(const DriftProfiles& profiles);

  /// False: every factor is 1 throughout, and nothing below need be asked.
  [[nodiscard]] bool any() const noexcept { return any_; }
  /// Back to the start.
  void start() noexcept;
  /// The brake acts: the origin of profiles that count from braking, the first time.
  void brake_applied() noexcept;
  /// How much of the `left_s` > 0 to come may be taken with the factors of its middle: to the next instant at which a
  /// piece of a profile ends, and no more than `max_step_s` while a factor changes.
  [[nodiscard]] double part_s(double left_s, double max_step_s) const noexcept;
  /// Lets time pass, no more than a part.
  void pass(double duration_s) noexcept;
  /// The factors after `time_s` from now, within a part.
  [[nodiscard]] DriftFactors after(double time_s) const noexcept;

 private:
  FactorProgress brake_torque_;
  FactorProgress motor_torque_;
  FactorProgress upper_bearing_;
  FactorProgress lower_bearing_;
  bool any_;
};

}  // namespace abs_hil::plant_sim

#pragma once

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// The controllers' model of the brake. It computes the duty for a torque by the inverse of (7). It estimates the
/// torque that acts in open loop, by the lag (6), because the rig has no torque sensor. Real-time safe.
class BrakeActuator {
 public:
  /// @param ideal the reference torque acts at once and without limits (`plant.ideal_actuator`)
  /// @param max_duty largest duty the gate lets pass, in (0, 1]
  BrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty) noexcept;

  /// Starts from a brake that has long been released.
  void reset() noexcept;
  /// Advances the model by `dt_s` under the duty of the last `command` (the torque, if ideal): exact solution of (6).
  void advance(double dt_s) noexcept;
  /// Stores the command that is sent now: its duty in [0, 1], or, if ideal, its torque, >= 0.
  void command(double duty, double torque_Nm) noexcept;

  /// Duty in [0, max_duty] for a reference torque. With an ideal actuator it is only recorded.
  [[nodiscard]] double duty_for(double torque_Nm) const noexcept;
  /// Static torque for a reference torque: within [0, max_torque_Nm], and 0 or b(u0) for torques that the dead
  /// zone makes unreachable.
  [[nodiscard]] double limited(double torque_Nm) const noexcept;
  /// b(max_duty); infinite if ideal.
  [[nodiscard]] double max_torque_Nm() const noexcept { return max_torque_Nm_; }
  [[nodiscard]] double torque_Nm() const noexcept { return torque_Nm_; }            ///< estimated, now
  [[nodiscard]] double mean_torque_Nm() const noexcept { return mean_torque_Nm_; }  ///< over the last `advance`

 private:
  rig::BrakeParameters brake_;
  bool ideal_;
  double max_duty_;
  double max_torque_Nm_;
  double target_Nm_{0.0};
  double torque_Nm_{0.0};
  double mean_torque_Nm_{0.0};
};

}  // namespace abs_hil::control

#pragma once

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// The brake as the controllers see it: duty for a wanted torque through the inverse of (7), and an open-loop estimate
/// of the torque that acts, through the lag (6), since the rig has no torque sensor. Real-time safe.
class BrakeActuator {
 public:
  /// @param ideal the torque asked for acts at once and without limits (`plant.ideal_actuator`)
  /// @param max_duty largest duty the gate lets pass, in (0, 1]
  BrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty) noexcept;

  /// The brake has been released for long.
  void reset() noexcept;
  /// Lets `dt_s` pass under the duty (the torque, if ideal) of the last `command`: exact solution of (6).
  void advance(double dt_s) noexcept;
  /// Takes note of what is sent now: the duty in [0, 1] counts, or, if ideal, the torque, >= 0.
  void command(double duty, double torque_Nm) noexcept;

  /// Duty in [0, max_duty] for a wanted torque; with an ideal actuator only for the record.
  [[nodiscard]] double duty_for(double torque_Nm) const noexcept;
  /// Static torque that comes of a wanted one: within [0, max_torque_Nm], and 0 or b(u0) for torques that the dead
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

#pragma once

#include <cstdint>

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// The controllers' model of the brake. It computes the duty for a torque by the inverse of (7). It estimates the
/// torque that acts in open loop, by the lag (6), because the rig has no torque sensor. Real-time safe.
class BrakeActuator {
 public:
  /// @param ideal the reference torque acts at once and without limits (`plant.ideal_actuator`)
  /// @param max_duty largest duty the gate lets pass, in (0, 1]
  /// @param duty_steps steps of the PWM from duty 0 to duty 1; 0: any duty can be sent
  BrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty, std::uint32_t duty_steps = 0) noexcept;

  /// Starts from a brake that has long been released.
  void reset() noexcept;
  /// Advances the model by `dt_s` under the duty of the last `command` (the torque, if ideal): exact solution of (6).
  void advance(double dt_s) noexcept;
  /// Stores the command that was sent now: its duty in [0, 1], or, if ideal, its torque, >= 0.
  void command(double duty, double torque_Nm) noexcept;

  /// The PWM's duty in [0, max_duty] whose torque is nearest to a reference torque. With an ideal actuator it is only
  /// recorded. NaN for a torque that is not finite.
  [[nodiscard]] double duty_for(double torque_Nm) const noexcept;
  /// Static torque of that duty, or, if ideal, the torque itself, at least 0.
  [[nodiscard]] double limited(double torque_Nm) const noexcept;
  /// A static torque and the duty that gives it.
  struct Target {
    double torque_Nm;
    double duty;
  };
  /// What to send for a reference torque, `dt_s` after the last call: `limited` and `duty_for`, except in the gap
  /// between 0 and the least torque that the dead zone leaves. There it switches between the two ends, so that their
  /// mean is the reference torque: nothing between them can be sent.
  [[nodiscard]] Target next(double torque_Nm, double dt_s) noexcept;
  /// What is missing of a finite reference torque in a static torque that was sent for it, N m: > 0 if less was sent
  /// (limits, rate limit, refusal), < 0 if more was sent. 0 if only the PWM's steps and the dead zone part the two.
  /// @param target_Nm  the torque of `next` for the reference torque
  [[nodiscard]] double unsent_Nm(double reference_Nm, double target_Nm, double sent_Nm) const noexcept;
  /// Static torque b(u) of a command; its torque, if ideal.
  [[nodiscard]] double static_torque_Nm(double duty, double torque_Nm) const noexcept;
  /// Static torque of the last `command`.
  [[nodiscard]] double sent_torque_Nm() const noexcept { return target_Nm_; }
  /// Largest torque that can be sent; infinite if ideal.
  [[nodiscard]] double max_torque_Nm() const noexcept { return max_torque_Nm_; }
  [[nodiscard]] double torque_Nm() const noexcept { return torque_Nm_; }            ///< estimated, now
  [[nodiscard]] double mean_torque_Nm() const noexcept { return mean_torque_Nm_; }  ///< over the last `advance`

 private:
  [[nodiscard]] bool in_gap(double torque_Nm) const noexcept;
  [[nodiscard]] Target nearest(double torque_Nm) const noexcept;

  rig::BrakeParameters brake_;
  bool ideal_;
  double max_duty_;
  std::uint32_t duty_steps_;
  double max_torque_Nm_;
  Target least_;  ///< the least above 0 that can be sent; 0 if ideal
  double half_step_Nm_;
  // In the gap: the end that is sent, for how long, and what is owed to the reference torque.
  Target end_{};
  double held_s_{0.0};
  double owed_Nms_{0.0};
  bool was_in_gap_{false};
  double target_Nm_{0.0};
  double torque_Nm_{0.0};
  double mean_torque_Nm_{0.0};
};

}  // namespace abs_hil::control

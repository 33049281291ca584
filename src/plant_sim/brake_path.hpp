// The flaws of a real brake before its lag.
#pragma once

#include <cstddef>
#include <vector>

#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/state_bytes.hpp"

namespace abs_hil::plant_sim {

/// What a real brake does to its command before the lag (6): dead time, a curved map, fading by the heat that is
/// in it, and the hysteresis of a cable; and by how much faster it lets go. Real-time safe except for the constructor.
class BrakePath {
 public:
  /// @param full_Nm  b(1)
  BrakePath(const BrakeFlaws& flaws, double full_Nm, bool ideal_actuator);

  /// False if the duty acts at once and gives b(u); then the calls below are unnecessary.
  [[nodiscard]] bool any() const noexcept {
    return delays() || fades() || hysteresis_ > 0.0 || curvature_ != 0.0 || release_ratio_ != 1.0;
  }
  /// Returns to a cold brake that has long been released.
  void start() noexcept;
  /// Stores the duty that is sent from now on.
  void command(double duty) noexcept;
  /// The duty that acts now.
  [[nodiscard]] double duty() const noexcept { return duty_; }
  /// Length of the next part under one duty: `left_s` > 0, but only up to the next change, and at most `max_step_s`
  /// while the brake fades.
  [[nodiscard]] double part_s(double left_s, double max_step_s) const noexcept;
  /// The torque at which a map that is no straight line holds the brake.
  /// @param straight_Nm  b(u) of the duty
  [[nodiscard]] double curved_Nm(double straight_Nm) const noexcept {
    return straight_Nm * (1.0 + curvature_ * (straight_Nm / full_Nm_ - 1.0));
  }
  /// Factor over c31 within a part. The torque approaches its target from one side.
  [[nodiscard]] double lag_factor(double target_Nm, double torque_Nm) const noexcept {
    return target_Nm < torque_Nm ? release_ratio_ : 1.0;
  }
  /// The torque that the lag approaches within a part, less what fading and hysteresis take.
  /// @param static_Nm  `curved_Nm` of the duty, times its drift
  /// @param power_W  of the brake at the part's start
  [[nodiscard]] double transmitted_Nm(double static_Nm, double part_s, double power_W) noexcept;
  /// Advances the time by one part.
  /// @param energy_J  that the brake has taken in it, >= 0
  void pass(double part_s, double energy_J) noexcept;

  void exchange_state(rig::StateBytes& state) {
    state(changes_, first_, count_, time_s_, newest_, duty_, held_Nm_, heat_J_);
  }

 private:
  struct Change {
    double due_s;
    double duty;
  };

  [[nodiscard]] bool delays() const noexcept { return !changes_.empty(); }
  [[nodiscard]] bool fades() const noexcept { return fading_per_J_ > 0.0; }
  /// Factor, less 1, over the heat that half of a part leaves.
  [[nodiscard]] double cooled(double part_s) const noexcept;
  [[nodiscard]] const Change& next() const noexcept { return changes_[first_]; }
  void settle() noexcept;

  double dead_time_s_;
  double hysteresis_;
  double fading_per_J_;
  double cooling_per_s_;
  double curvature_;
  double full_Nm_;
  double release_ratio_;
  std::vector<Change> changes_;  ///< a ring of the changes on their way; empty: without dead time
  std::size_t first_{0};
  std::size_t count_{0};
  double time_s_{0.0};
  double newest_{0.0};  ///< duty of the last command
  double duty_{0.0};
  double held_Nm_{0.0};  ///< behind the hysteresis
  double heat_J_{0.0};
};

}  // namespace abs_hil::plant_sim

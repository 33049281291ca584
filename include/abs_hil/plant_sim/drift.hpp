#pragma once

// What changes a plant while it runs: the profiles of its drifting parameters, and the flaws of a real brake before its
// lag (docs/plants.md).

#include <array>
#include <cstddef>
#include <limits>

#include "abs_hil/plant_sim/factor_profile.hpp"
#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/state_bytes.hpp"

namespace abs_hil::plant_sim {

/// A factor from one instant to the end of the profile's piece: linear in the time since then and in the lower wheel's
/// angle.
struct PresentFactor {
  double value{1.0};
  double per_s{0.0};
  double per_rad{0.0};
  double angle2_rad{0.0};                                          ///< angle at which `value` holds
  double end_angle2_rad{std::numeric_limits<double>::infinity()};  ///< end of the piece along the distance
  double highest{1.0};                                             ///< highest value on the piece

  [[nodiscard]] double after(double time_s, double angle2) const noexcept {
    return value + per_s * time_s + per_rad * (angle2 - angle2_rad);
  }
  /// True if the factor does not change on this piece.
  [[nodiscard]] bool holds() const noexcept { return per_s == 0.0 && per_rad == 0.0; }
};

/// A plant's position in a profile. Passed pieces do not return, even if the lower wheel rolls back. Real-time safe
/// except for the constructor.
class FactorProgress {
 public:
  /// @param r2_m  radius of the lower wheel
  FactorProgress(const FactorProfile& profile, double r2_m)
      : profile_(profile),
        r2_m_(r2_m),
        changes_(profile.pieces().size() > 1),
        constant_(profile.pieces().front().value) {
    start(0.0);
  }

  [[nodiscard]] const FactorProfile& profile() const noexcept { return profile_; }

  /// Returns to the start, with the lower wheel at that angle.
  void start(double angle2_rad) noexcept;
  /// Call when the brake acts. The first call sets the origin of profiles that count from braking.
  void brake_applied(double angle2_rad) noexcept;
  /// Advances the time.
  void pass(double duration_s) noexcept { time_s_ += duration_s; }
  /// Moves to the piece that holds from now on.
  void settle(double angle2_rad) noexcept {
    if (changes_) settle_on_changes(angle2_rad);
  }

  /// Time until the piece ends; infinite if it has no end or ends by distance.
  [[nodiscard]] double time_left_s() const noexcept {
    if (!changes_ || !counting_ || !along_time()) return std::numeric_limits<double>::infinity();
    return origin_time_s_ + piece().end - time_s_;
  }
  /// How long the factor stays as it is; 0 while it changes, and until the brake is applied if it counts from there.
  [[nodiscard]] double steady_s() const noexcept {
    if (!changes_) return std::numeric_limits<double>::infinity();
    return counting_ && piece().slope == 0.0 ? time_left_s() : 0.0;
  }
  /// The lower wheel's angle up to which it stays so.
  [[nodiscard]] double steady_to_angle2_rad() const noexcept {
    return !changes_ || along_time() ? std::numeric_limits<double>::infinity() : end_angle2_rad();
  }
  /// Scales the whole profile from now on, by a factor > 0. `start` leaves it.
  void scale(double factor) noexcept { scale_ = factor; }
  void exchange_state(rig::StateBytes& state) {
    state(index_, time_s_, origin_time_s_, origin_angle2_rad_, counting_, scale_);
  }
  /// False if the factor is always 1.
  [[nodiscard]] bool changes_anything() const noexcept { return changes_ || constant_ != 1.0; }
  [[nodiscard]] PresentFactor present(double angle2_rad) const noexcept {
    if (changes_) return present_of_changes(angle2_rad);
    const double value = scale_ * constant_;
    return {.value = value, .angle2_rad = angle2_rad, .highest = value};
  }

 private:
  void settle_on_changes(double angle2_rad) noexcept;
  [[nodiscard]] PresentFactor present_of_changes(double angle2_rad) const noexcept;
  [[nodiscard]] bool along_time() const noexcept { return profile_.axis() == FactorProfile::Axis::time; }
  [[nodiscard]] const FactorProfile::Piece& piece() const noexcept { return profile_.pieces()[index_]; }
  [[nodiscard]] double end_angle2_rad() const noexcept { return origin_angle2_rad_ + piece().end / r2_m_; }

  FactorProfile profile_;
  double r2_m_;
  bool changes_;     ///< false: the factor is constant, and updates cost almost nothing
  double constant_;  ///< the factor if it is constant
  std::size_t index_{0};
  double time_s_{0.0};
  double origin_time_s_{0.0};
  double origin_angle2_rad_{0.0};
  bool counting_{true};  ///< the origin has been passed
  double scale_{1.0};
};

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
    for (FactorProgress& factor : factors_) factor.exchange_state(state);
  }

 private:
  std::array<FactorProgress, 4> factors_;  ///< in the order of DriftFactors
  bool any_;
};

/// What a real brake does to its command before the lag (6): dead times, a curved map, an overshoot as it takes hold,
/// fading by the heat that is in it, and the hysteresis of a cable; and by how much faster it lets go. Real-time safe
/// except for the constructor.
///
///     heat       E' = T omega1 - q E,  torque times exp(-k E)
///     overshoot  at duty 1 the torque b(1) (1 + g (1 - z)),  z' = r (1 - z) while the duty is above u0, else z' = -r z
class BrakePath {
 public:
  BrakePath(const BrakeFlaws& flaws, const rig::BrakeParameters& brake, bool ideal_actuator);

  /// False if the duty acts at once and gives b(u); then the calls below are unnecessary.
  [[nodiscard]] bool any() const noexcept {
    return delay_.any() || fades() || hysteresis_ > 0.0 || curvature_ != 0.0 || release_ratio_ != 1.0 ||
           overshoot_ > 0.0;
  }
  /// Returns to a cold brake that has long been released.
  void start() noexcept;
  /// Takes the duty that is sent from now on.
  void command(double duty) noexcept;
  /// Length of the next part under one duty: `left_s` > 0, but only up to the next change, and at most `max_step_s`
  /// while the brake fades or overshoots.
  [[nodiscard]] double part_s(double left_s, double max_step_s) const noexcept;
  /// The torque at which map and overshoot hold the brake within a part.
  [[nodiscard]] double static_Nm(double part_s) const noexcept;
  /// Factor over c31 within a part. The torque approaches its target from one side.
  [[nodiscard]] double lag_factor(double target_Nm, double torque_Nm) const noexcept {
    return target_Nm < torque_Nm ? release_ratio_ : 1.0;
  }
  /// The torque that the lag approaches within a part, less what fading and hysteresis take.
  /// @param static_Nm  `static_Nm` of the part, times its drift
  /// @param power_W  of the brake at the part's start
  [[nodiscard]] double transmitted_Nm(double static_Nm, double part_s, double power_W) noexcept;
  /// Advances the time by one part.
  /// @param energy_J  that the brake has taken in it, >= 0
  void pass(double part_s, double energy_J) noexcept;

  void exchange_state(rig::StateBytes& state) {
    delay_.exchange_state(state);
    state(duty_, engaged_, held_Nm_, heat_J_);
  }

 private:
  [[nodiscard]] bool fades() const noexcept { return fading_per_J_ > 0.0; }
  /// Factor, less 1, over the heat that half of a part leaves.
  [[nodiscard]] double cooled(double part_s) const noexcept;
  [[nodiscard]] double engaged_after(double time_s) const noexcept;

  rig::BrakeParameters brake_;
  rig::BrakeDelay delay_;
  double hysteresis_;
  double fading_per_J_;
  double cooling_per_s_;
  double curvature_;
  double full_Nm_;  ///< b(1)
  double release_ratio_;
  double overshoot_;
  double overshoot_per_s_;
  double duty_{0.0};     ///< that acts
  double engaged_{0.0};  ///< z
  double held_Nm_{0.0};  ///< behind the hysteresis
  double heat_J_{0.0};
};

}  // namespace abs_hil::plant_sim

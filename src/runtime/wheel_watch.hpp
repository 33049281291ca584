#pragma once

#include <type_traits>

#include "abs_hil/rig/scalar.hpp"
#include "runtime/plausibility_limits.hpp"
#include "runtime/speed_window.hpp"

namespace abs_hil::runtime {

/// The speeds that one wheel can have. The interval widens as fast as physics lets the wheel gain and lose speed, and
/// each reading inside narrows it. `S` is a `double`, or a pack of them (rig/scalar.hpp). Real-time safe.
template <class S>
class SpeedBounds {
 public:
  SpeedBounds() = default;
  SpeedBounds(const S& gain_rad_s2, const S& loss_rad_s2, const S& fastest_rad_s) noexcept
      : gain_rad_s2_(gain_rad_s2), loss_rad_s2_(loss_rad_s2), high_rad_s_(fastest_rad_s) {}

  /// Uncertainty of a mean speed over `dt_s`. @param resolution_rad_s  from counting @param stamp_error_s  of `dt_s`
  [[nodiscard]] static S slack_rad_s(const S& omega_rad_s, const S& resolution_rad_s, const S& dt_s,
                                     const S& stamp_error_s) noexcept {
    constexpr double least_stamp_error_s = 150e-6;
    const S error_s = rig::larger(stamp_error_s, S(least_stamp_error_s));
    return resolution_rad_s + rig::magnitude(omega_rad_s) * error_s / (dt_s - error_s);
  }
  /// Takes a mean speed over `dt_s`. True if it lies inside.
  [[nodiscard]] auto take(const S& omega_rad_s, const S& slack_rad_s, const S& dt_s) noexcept {
    constexpr double backwards_rad_s = 2.0;  // speed at which a stopped wheel may swing back
    low_rad_s_ = rig::larger(S(low_rad_s_ - loss_rad_s2_ * dt_s), S(-backwards_rad_s));
    high_rad_s_ += gain_rad_s2_ * dt_s;
    const auto inside = omega_rad_s + slack_rad_s >= low_rad_s_ && omega_rad_s - slack_rad_s <= high_rad_s_;
    if (!rig::any(inside)) return inside;
    // The reading is a mean over dt. At its end the wheel may be faster or slower by what dt allows.
    const S low_rad_s = rig::larger(low_rad_s_, S(omega_rad_s - slack_rad_s - loss_rad_s2_ * dt_s));
    const S high_rad_s = rig::smaller(high_rad_s_, S(omega_rad_s + slack_rad_s + gain_rad_s2_ * dt_s));
    low_rad_s_ = select_asked(inside, low_rad_s, low_rad_s_);
    high_rad_s_ = select_asked(inside, high_rad_s, high_rad_s_);
    return inside;
  }

 private:
  S gain_rad_s2_{0.0};
  S loss_rad_s2_{0.0};
  S low_rad_s_{0.0};
  S high_rad_s_{0.0};
};

/// What EncoderCheck asks in every speed window before it looks closer: whether all is quiet. Real-time safe.
template <class S>
class WheelWatch {
 public:
  WheelWatch() = default;
  explicit WheelWatch(const PlausibilityLimits& limits) noexcept
    requires std::is_same_v<S, double>
      : c31_per_s_(limits.ideal_actuator ? at_once_per_s : limits.brake.c31_per_s),
        r1_m_(limits.wheels.r1_m),
        r2_m_(limits.wheels.r2_m),
        released_brake_Nm_(limits.released_brake_Nm),
        free_slip_max_(limits.free_slip_max) {}

  // docs/safety.md, "Where the bounds come from", derives these.
  /// A locked wheel rolls again within this time after its release, and a lifted one after it was lowered.
  static constexpr double rolled_after_s = 3.0;
  static constexpr double fastest = 1.05;  ///< a braked wheel's tread against the lower wheel's

  /// Takes the brake's command over the window.
  void expect_brake(const BasicSpeedWindow<S>& window) noexcept {
    constexpr double earnest_brake_Nm = 1.0;
    // (6) by the implicit Euler rule. Its relative error is the speed window's share of the lag, 4 %.
    const S share = c31_per_s_ * window.dt_s;
    brake_Nm_ = (brake_Nm_ + share * window.brake_target_Nm) / (1.0 + share);
    free_s_ = rig::select(window.brake_target_Nm > 0.0, S(0.0), S(free_s_ + window.dt_s));
    braked_s_ = rig::select(brake_Nm_ >= earnest_brake_Nm, S(braked_s_ + window.dt_s), S(0.0));
  }
  /// True unless a tyre that slides should have spun up the upper wheel. In a long speed window a braked wheel may
  /// lock, so its interval reaches down to standstill. Once the brake has let go, a tyre that slides on a turning wheel
  /// must spin it up: an encoder without counts is then stuck. @param standing_rad  its way since it stands
  [[nodiscard]] auto quiet_standing(const BasicSpeedWindow<S>& window, const S& standing_rad) const noexcept {
    return not_standing(window) || moved(window, standing_rad);
  }
  [[nodiscard]] auto moved(const BasicSpeedWindow<S>& window, const S& standing_rad) const noexcept {
    return rig::magnitude(standing_rad) > window.resolution_rad_s * window.dt_s;
  }
  [[nodiscard]] auto not_standing(const BasicSpeedWindow<S>& window) const noexcept {
    constexpr double standing_speed_m_s = 1.0;  // of the lower wheel's tread, which then spins up the upper wheel
    return brake_Nm_ > released_brake_Nm_ || r2_m_ * window.omega2_rad_s < standing_speed_m_s;
  }
  /// By how much the treads may differ while both wheels roll.
  [[nodiscard]] S allowed_m_s(const BasicSpeedWindow<S>& window) const noexcept {
    constexpr double disagreement_m_s = 0.3;  // in addition to `free_slip_max`
    return disagreement_m_s +
           free_slip_max_ * rig::larger(rig::magnitude(S(r1_m_ * window.omega1_rad_s)),
                                        rig::magnitude(S(r2_m_ * window.omega2_rad_s))) +
           r2_m_ * window.resolution_rad_s;
  }
  [[nodiscard]] auto quiet_rolling(const BasicSpeedWindow<S>& window) const noexcept {
    const auto braked = free_s_ < rolled_after_s;
    if (!rig::any(!braked)) return braked;
    const S v1_m_s = r1_m_ * window.omega1_rad_s;
    const S v2_m_s = r2_m_ * window.omega2_rad_s;
    const S stamps_m_s = (rig::magnitude(v1_m_s) + rig::magnitude(v2_m_s)) * window.stamp_error_s() / window.dt_s;
    const auto agree = rig::magnitude(S(v1_m_s - v2_m_s)) + stamps_m_s <= allowed_m_s(window);
    return !select_asked(!braked, !agree);
  }
  [[nodiscard]] auto quiet_slip(const BasicSpeedWindow<S>& window) const noexcept {
    constexpr double braked_after_s = 0.15;
    constexpr double slip_speed_m_s = 3.0;
    const S v1_m_s = r1_m_ * window.omega1_rad_s;
    const S v2_m_s = r2_m_ * window.omega2_rad_s;
    const S stamps_m_s = (v1_m_s + fastest * v2_m_s) * window.stamp_error_s() / window.dt_s;
    return braked_s_ < braked_after_s || v2_m_s <= slip_speed_m_s || v1_m_s + stamps_m_s <= fastest * v2_m_s;
  }

  /// Brake torque expected from the map (7) and the lag (6), N m.
  [[nodiscard]] S brake_Nm() const noexcept { return brake_Nm_; }

 private:
  /// Lag of an ideal actuator: after any window the rest of the torque before is below a bit of the new one.
  static constexpr double at_once_per_s = 1e24;

  S c31_per_s_{0.0};
  S r1_m_{0.0};
  S r2_m_{0.0};
  S released_brake_Nm_{0.0};
  S free_slip_max_{0.0};
  S brake_Nm_{0.0};
  S free_s_{rolled_after_s};  ///< time since the brake was released
  S braked_s_{0.0};           ///< time with a brake torque of at least 1 N m
};

}  // namespace abs_hil::runtime

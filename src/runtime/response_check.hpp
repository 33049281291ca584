#pragma once

#include <type_traits>

#include "abs_hil/rig/scalar.hpp"
#include "runtime/speed_window.hpp"

namespace abs_hil::runtime {

/// Checks that motor and brake have the effect that their commands should have, by the momentum
/// p = J1 w1 / r1 + J2 w2 / r2 of both wheels. The tyre force cancels in p, on any road:
/// p' = motor/r2 - (brake + friction)/r1 - friction/r2. It compares the means of p over windows of 0.1 s, or of up
/// to 1 s if time stamps or counts make p less certain. Real-time safe.
template <class S>
class MomentumWatch {
 public:
  MomentumWatch() = default;
  explicit MomentumWatch(const PlausibilityLimits& limits) noexcept
    requires std::is_same_v<S, double>
      : J1_per_r1_kg_m_(limits.wheels.J1_kg_m2 / limits.wheels.r1_m),
        J2_per_r2_kg_m_(limits.wheels.J2_kg_m2 / limits.wheels.r2_m),
        r1_m_(limits.wheels.r1_m),
        r2_m_(limits.wheels.r2_m),
        half_rolling_(0.5 * limits.wheels.r2_m / limits.wheels.r1_m),
        d2_Nms_rad_(limits.wheels.d2_Nms_rad),
        M20_Nm_(limits.wheels.M20_Nm),
        no_load_speed_rad_s_(limits.motor.no_load_speed_rad_s) {}

  /// Where a comparison found a fault, and the momentum gained. `due`: there was one.
  template <class Condition>
  struct Verdict {
    Condition due;
    Condition rises;  ///< although the motor is off
    Condition motor_silent;
    Condition brake_silent;
    S gained_kg_m_s;
    [[nodiscard]] Condition quiet() const noexcept { return !(due && (rises || motor_silent || brake_silent)); }
  };

  /// Adds to the window. True where it ends. @param brake_Nm expected brake torque
  [[nodiscard]] auto take(const BasicSpeedWindow<S>& speed_window, const S& brake_Nm) noexcept {
    add(speed_window, brake_Nm);
    const auto lasts = now_.lasted_s >= window_s;
    if (!rig::any(lasts)) return lasts;
    now_.end_error_s = speed_window.end_error_s;
    now_.counts_rad = speed_window.resolution_rad_s * speed_window.dt_s;
    const auto uncertain = now_.lasted_s < longest_window_s && slack_kg_m_s(now_) > slack_N * now_.lasted_s;
    return select_asked(lasts, !uncertain);
  }
  /// Compares the windows that end with those before them. @param ends  what `take` said, true in any lane
  template <class Condition>
  [[nodiscard]] auto conclude(const Condition& ends) noexcept {
    auto verdict = judge(before_, now_);
    verdict.due = select_asked(ends, before_.lasted_s > 0.0);
    before_ = chosen(ends, now_, before_);
    now_ = chosen(ends, Window{}, now_);
    return verdict;
  }
  /// A wheel that is apart from the other one stops sooner under the brake: the check of the brake allows for it.
  void note_wheels_apart(bool apart) noexcept { apart_ = S(apart ? 1.0 : 0.0); }

 private:
  // docs/safety.md, "Where the bounds come from", derives these.
  static constexpr double window_s = 0.1;
  static constexpr double longest_window_s = 1.0;  ///< a window lasts no longer, however uncertain its momentum is
  static constexpr double slack_N = 1.0;  ///< uncertainty of the momentum, per second of the window, that ends a window

  /// Sums over one window.
  struct Window {
    S lasted_s{0.0};
    S travel_kg_m{0.0};    ///< integral of p
    S upper_kg_m{0.0};     ///< the upper wheel's part of it, while the wheels are apart
    S motor_Nms{0.0};      ///< integral of the torque that the motor should give, less twice the friction
    S brake_Nms{0.0};      ///< integral of the brake torque expected
    S begin_error_s{0.0};  ///< uncertainty of the stamps at its ends
    S end_error_s{0.0};
    S counts_rad{0.0};  ///< two counts
    S least_brake_Nm{1e9};
    S most_brake_Nm{0.0};
    S most_duty{0.0};  ///< largest duty of the motor
    S rolls{1.0};      ///< 1: the upper wheel's speed is at least half of rolling speed
    S apart{0.0};      ///< 1: the wheels were apart in some of it
  };
  /// `a` where the window ends, else `b`.
  template <class Condition>
  [[nodiscard]] static Window chosen(const Condition& ends, const Window& a, const Window& b) noexcept {
    Window window;
    for (S Window::*sum :
         {&Window::lasted_s, &Window::travel_kg_m, &Window::upper_kg_m, &Window::motor_Nms, &Window::brake_Nms,
          &Window::begin_error_s, &Window::end_error_s, &Window::counts_rad, &Window::least_brake_Nm,
          &Window::most_brake_Nm, &Window::most_duty, &Window::rolls, &Window::apart}) {
      window.*sum = select_asked(ends, a.*sum, b.*sum);
    }
    return window;
  }
  void add(const BasicSpeedWindow<S>& speed_window, const S& brake_Nm) noexcept;
  /// Uncertainty of the window's mean momentum, kg m/s.
  [[nodiscard]] S slack_kg_m_s(const Window& window) const noexcept {
    const S p_kg_m_s = rig::magnitude(window.travel_kg_m) / window.lasted_s;
    const S counts_kg_m = (J1_per_r1_kg_m_ + J2_per_r2_kg_m_) * window.counts_rad;
    return (p_kg_m_s * (window.begin_error_s + window.end_error_s) + counts_kg_m) / window.lasted_s;
  }
  [[nodiscard]] auto judge(const Window& before, const Window& now) const noexcept;

  S J1_per_r1_kg_m_{0.0};
  S J2_per_r2_kg_m_{0.0};
  S r1_m_{0.0};
  S r2_m_{0.0};
  S half_rolling_{0.0};  ///< half of the ratio of the upper wheel's speed to the lower one's while both roll
  S d2_Nms_rad_{0.0};
  S M20_Nm_{0.0};
  S no_load_speed_rad_s_{0.0};
  S apart_{0.0};
  Window before_{};
  Window now_{};
};

template <class S>
void MomentumWatch<S>::add(const BasicSpeedWindow<S>& s, const S& brake_Nm) noexcept {
  constexpr double friction_margin = 2.0;
  const S p1_kg_m_s = J1_per_r1_kg_m_ * s.omega1_rad_s;
  const S p_kg_m_s = p1_kg_m_s + J2_per_r2_kg_m_ * s.omega2_rad_s;
  const S motor_Nm = s.motor_stall_Nm * (1.0 - s.omega2_rad_s / no_load_speed_rad_s_);
  const S friction_Nm = M20_Nm_ + d2_Nms_rad_ * s.omega2_rad_s;
  const auto begins = now_.lasted_s == 0.0;
  if (rig::any(begins)) [[unlikely]]
    now_.begin_error_s = select_asked(begins, s.begin_error_s, now_.begin_error_s);
  now_.lasted_s += s.dt_s;
  now_.travel_kg_m += p_kg_m_s * s.dt_s;
  now_.motor_Nms += (motor_Nm - friction_margin * friction_Nm) * s.dt_s;
  now_.brake_Nms += brake_Nm * s.dt_s;
  now_.least_brake_Nm = rig::smaller(now_.least_brake_Nm, brake_Nm);
  now_.most_brake_Nm = rig::larger(now_.most_brake_Nm, brake_Nm);
  now_.most_duty = rig::larger(now_.most_duty, s.motor_duty);
  now_.rolls = rig::select(s.omega1_rad_s >= half_rolling_ * s.omega2_rad_s, now_.rolls, S(0.0));
  const auto apart = apart_ > 0.0;
  if (rig::any(apart)) [[unlikely]] {
    now_.apart = select_asked(apart, S(1.0), now_.apart);
    now_.upper_kg_m = select_asked(apart, S(now_.upper_kg_m + p1_kg_m_s * s.dt_s), now_.upper_kg_m);
  }
}

template <class S>
auto MomentumWatch<S>::judge(const Window& before, const Window& now) const noexcept {
  // docs/safety.md, "Where the bounds come from", derives these.
  constexpr double rise_max_kg_m_s = 0.25;     // from errors of encoders and time stamps
  constexpr double motor_counts_kg_m_s = 0.3;  // a smaller expected impulse of the motor is not checked
  constexpr double motor_part = 0.25;          // share of the expected impulse that must be measured
  constexpr double idle_brake_Nm = 0.1;
  constexpr double earnest_brake_Nm = 1.5;
  constexpr double moving_kg_m_s = 5.0;  // below this the wheels are about to stop, and the brake is not checked
  constexpr double brake_part = 0.3;
  const S p_kg_m_s = now.travel_kg_m / now.lasted_s;
  const S gained_kg_m_s = p_kg_m_s - before.travel_kg_m / before.lasted_s;
  const S slack_sum_kg_m_s = slack_kg_m_s(before) + slack_kg_m_s(now);
  const S motor_kg_m_s = 0.5 * (before.motor_Nms + now.motor_Nms) / r2_m_;
  const S brake_kg_m_s = 0.5 * (before.brake_Nms + now.brake_Nms) / r1_m_;
  const auto motor_off = before.most_duty == 0.0 && now.most_duty == 0.0;
  const auto brake_idle = rig::larger(before.most_brake_Nm, now.most_brake_Nm) < idle_brake_Nm;
  // A brake can take from a wheel alone what this wheel has. One that has more left cannot have stopped meanwhile.
  const auto alone = now.apart > 0.0;
  const auto must_slow = (alone && now.upper_kg_m / now.lasted_s > brake_kg_m_s) ||
                         (!alone && before.rolls > 0.0 && now.rolls > 0.0 && p_kg_m_s > moving_kg_m_s);
  const auto braking =
      motor_off && must_slow && rig::smaller(before.least_brake_Nm, now.least_brake_Nm) >= earnest_brake_Nm;
  using Condition = std::remove_const_t<decltype(motor_off)>;
  return Verdict<Condition>{.due = motor_off,
                            .rises = motor_off && gained_kg_m_s - slack_sum_kg_m_s > rise_max_kg_m_s,
                            .motor_silent = brake_idle && motor_kg_m_s > motor_counts_kg_m_s &&
                                            gained_kg_m_s + slack_sum_kg_m_s < motor_part * motor_kg_m_s,
                            .brake_silent = braking && gained_kg_m_s - slack_sum_kg_m_s > -brake_part * brake_kg_m_s,
                            .gained_kg_m_s = gained_kg_m_s};
}

/// The same as one check: what it found, with its reason.
class ResponseCheck : public MomentumWatch<double> {
 public:
  using MomentumWatch::MomentumWatch;
  /// @param brake_Nm expected brake torque
  CheckResult update(const SpeedWindow& speed_window, double brake_Nm) noexcept;
};

}  // namespace abs_hil::runtime

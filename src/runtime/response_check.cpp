#include "runtime/response_check.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::runtime {

namespace {

using rig::Reason;

// docs/safety.md, "Where the bounds come from", derives these.
constexpr double window_s = 0.1;
constexpr double longest_window_s = 1.0;  ///< a window lasts no longer, however uncertain its momentum is
constexpr double slack_N = 1.0;           ///< uncertainty of the momentum, per second of the window, that ends a window
constexpr double rise_max_kg_m_s =
    0.25;  ///< largest rise of the momentum in a window from errors of encoders and time stamps
constexpr double motor_counts_kg_m_s = 0.3;  ///< a smaller expected impulse of the motor is not checked
constexpr double motor_part = 0.25;          ///< share of the expected impulse that must be measured
constexpr double idle_brake_Nm = 0.1;
constexpr double earnest_brake_Nm = 1.5;
constexpr double moving_kg_m_s =
    5.0;  ///< below this momentum the wheels are about to stop, and the brake is not checked
constexpr double brake_part = 0.3;
constexpr double friction_margin = 2.0;

}  // namespace

CheckResult ResponseCheck::update(const SpeedWindow& s, double brake_Nm) noexcept {
  const rig::WheelParameters& w = limits_.wheels;
  const double p1_kg_m_s = w.J1_kg_m2 * s.omega1_rad_s / w.r1_m;
  const double p_kg_m_s = p1_kg_m_s + w.J2_kg_m2 * s.omega2_rad_s / w.r2_m;
  const double motor_Nm =
      limits_.motor.stall_torque_Nm * s.motor_duty * (1.0 - s.omega2_rad_s / limits_.motor.no_load_speed_rad_s);
  const double friction_Nm = w.M20_Nm + w.d2_Nms_rad * s.omega2_rad_s;
  if (now_.lasted_s == 0.0) now_.begin_error_s = s.begin_error_s;
  now_.end_error_s = s.end_error_s;
  now_.counts_rad = s.resolution_rad_s * s.dt_s;
  now_.lasted_s += s.dt_s;
  now_.travel_kg_m += p_kg_m_s * s.dt_s;
  now_.motor_kg_m_s += (motor_Nm - friction_margin * friction_Nm) / w.r2_m * s.dt_s;
  now_.brake_kg_m_s += brake_Nm / w.r1_m * s.dt_s;
  now_.least_brake_Nm = std::min(now_.least_brake_Nm, brake_Nm);
  now_.most_brake_Nm = std::max(now_.most_brake_Nm, brake_Nm);
  now_.most_duty = std::max(now_.most_duty, s.motor_duty);
  now_.rolls = now_.rolls && w.r1_m * s.omega1_rad_s >= 0.5 * w.r2_m * s.omega2_rad_s;
  if (apart_) [[unlikely]] {
    now_.apart = true;
    now_.upper_kg_m += p1_kg_m_s * s.dt_s;
  }
  if (now_.lasted_s < window_s) return {};
  if (now_.lasted_s < longest_window_s && slack_kg_m_s(now_) > slack_N * now_.lasted_s) return {};
  const CheckResult result = before_.lasted_s > 0.0 ? judge(before_, now_) : CheckResult{};
  before_ = now_;
  now_ = {};
  return result;
}

double ResponseCheck::slack_kg_m_s(const Window& window) const noexcept {
  const rig::WheelParameters& w = limits_.wheels;
  const double p_kg_m_s = std::abs(window.travel_kg_m) / window.lasted_s;
  const double counts_kg_m = (w.J1_kg_m2 / w.r1_m + w.J2_kg_m2 / w.r2_m) * window.counts_rad;
  return (p_kg_m_s * (window.begin_error_s + window.end_error_s) + counts_kg_m) / window.lasted_s;
}

CheckResult ResponseCheck::judge(const Window& before, const Window& now) const noexcept {
  const double p_kg_m_s = now.travel_kg_m / now.lasted_s;
  const double gained_kg_m_s = p_kg_m_s - before.travel_kg_m / before.lasted_s;
  const double slack_sum_kg_m_s = slack_kg_m_s(before) + slack_kg_m_s(now);
  const double motor_kg_m_s = 0.5 * (before.motor_kg_m_s + now.motor_kg_m_s);
  const double brake_kg_m_s = 0.5 * (before.brake_kg_m_s + now.brake_kg_m_s);
  const bool motor_off = before.most_duty == 0.0 && now.most_duty == 0.0;
  if (motor_off && gained_kg_m_s - slack_sum_kg_m_s > rise_max_kg_m_s)
    return {Reason::speed_rises_with_motor_off, gained_kg_m_s};
  const bool brake_idle = std::max(before.most_brake_Nm, now.most_brake_Nm) < idle_brake_Nm;
  if (brake_idle && motor_kg_m_s > motor_counts_kg_m_s &&
      gained_kg_m_s + slack_sum_kg_m_s < motor_part * motor_kg_m_s) {
    return {Reason::motor_no_response, gained_kg_m_s};
  }
  // A brake can take from a wheel alone what this wheel has. One that has more left cannot have stopped meanwhile.
  const bool must_slow =
      now.apart ? now.upper_kg_m / now.lasted_s > brake_kg_m_s : before.rolls && now.rolls && p_kg_m_s > moving_kg_m_s;
  const bool braking =
      motor_off && must_slow && std::min(before.least_brake_Nm, now.least_brake_Nm) >= earnest_brake_Nm;
  if (braking && gained_kg_m_s - slack_sum_kg_m_s > -brake_part * brake_kg_m_s)
    return {Reason::brake_no_response, gained_kg_m_s};
  return {};
}

}  // namespace abs_hil::runtime

// Rates of the wheels and of the slip as a controller models them, and small helpers of laws that use them.
#pragma once

#include <numbers>

#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

/// Below this speed an encoder cannot tell a turning wheel from a standing one.
inline constexpr double standing_rad_s = 1.0;

/// On a wheel that does not turn, brake and friction hold each other, and the motion says nothing about the tyre force.
/// Real-time safe.
template <class S>
[[nodiscard]] constexpr auto turns(const S& omega_rad_s) noexcept {
  return omega_rad_s >= standing_rad_s;
}

/// The same direction within half a turn of 0: sines of angles that grow for ever lose digits. Real-time safe.
template <class S>
[[nodiscard]] S within_half_turn_rad(const S& angle_rad) noexcept {
  constexpr double turn_rad = 2.0 * std::numbers::pi;
  return angle_rad - turn_rad * rig::round_down(S(angle_rad / turn_rad + 0.5));
}

/// The controller's estimate of the loads on the wheels.
template <class S>
struct WheelLoads {
  S tyre_force_N{0.0};
  S brake_torque_Nm{0.0};
};

/// Rates of the wheels and their slip under given loads, by (1), (2), (5) and (13).
template <class S>
struct WheelMotion {
  S omega1_rate_rad_s2{0.0};
  S omega2_rate_rad_s2{0.0};
  S error_rate_m_s2{0.0};  ///< e_v' at a constant slip reference
  S slip_rate_per_s{0.0};  ///< of (5)
  S drift_rate_m_s3{0.0};  ///< of `friction_drift_m_s2`
};

/// @param slip  slip at `speeds`
/// @param v_min_m_s  the slip's rate divides by at least this car speed, > 0
/// Both wheels turn forwards. Real-time safe.
template <class S>
[[nodiscard]] WheelMotion<S> wheel_motion(const paper::Laws<S>& w, const rig::BasicWheelSpeeds<S>& speeds,
                                          const S& slip, const S& slip_ref, const WheelLoads<S>& loads,
                                          const S& v_min_m_s) noexcept {
  WheelMotion<S> motion;
  motion.omega1_rate_rad_s2 =
      (w.r1 * loads.tyre_force_N - w.d1 * speeds.omega1_rad_s - w.M10 - loads.brake_torque_Nm) / w.J1;
  motion.omega2_rate_rad_s2 = (-w.r2 * loads.tyre_force_N - w.d2 * speeds.omega2_rad_s - w.M20) / w.J2;
  const S upper_m_s2 = w.r1 * motion.omega1_rate_rad_s2;
  const S lower_m_s2 = w.r2 * motion.omega2_rate_rad_s2;
  const S v_x = rig::larger(S(w.r2 * speeds.omega2_rad_s), v_min_m_s);
  motion.error_rate_m_s2 = paper::Laws<S>::e_v_dot(slip_ref, lower_m_s2, upper_m_s2);
  motion.slip_rate_per_s = ((1.0 - slip) * lower_m_s2 - upper_m_s2) / v_x;
  motion.drift_rate_m_s3 = -w.r1 / w.J1 * w.d1 * motion.omega1_rate_rad_s2 +
                           (1.0 - slip_ref) * w.r2 / w.J2 * w.d2 * motion.omega2_rate_rad_s2;
  return motion;
}

/// The input with other speeds, and their slip, `where` the condition holds. Real-time safe.
template <class S, class Condition>
[[nodiscard]] BasicSlipInput<S> with_speeds(const BasicSlipInput<S>& input, const Condition& where,
                                            const rig::BasicWheelSpeeds<S>& speeds, const paper::Laws<S>& w,
                                            const S& v_min_m_s) noexcept {
  BasicSlipInput<S> result = input;
  const S slip = rig::wheel_slip(S(w.r1 * speeds.omega1_rad_s), S(w.r2 * speeds.omega2_rad_s), v_min_m_s);
  result.speeds.omega1_rad_s = rig::select(where, speeds.omega1_rad_s, input.speeds.omega1_rad_s);
  result.speeds.omega2_rad_s = rig::select(where, speeds.omega2_rad_s, input.speeds.omega2_rad_s);
  result.slip = rig::select(where, slip, input.slip);
  return result;
}

/// The brake's lag (6) for a torque that is held over a period.
template <class S>
class BasicBrakeLag {
 public:
  BasicBrakeLag() = default;
  /// @param c31_per_s, period_s  > 0
  BasicBrakeLag(double c31_per_s, double period_s) noexcept
      : covered_{-rig::exponential_less_one(-c31_per_s * period_s)} {}

  /// Static torque b to hold for one period so that the torque changes by `change_Nm`: it covers 1 - exp(-c31 h) of the
  /// distance to b. For h -> 0 this is Tb + Tb'/c31. May lie outside what the actuator can give. Real-time safe.
  [[nodiscard]] S command_Nm(const S& torque_Nm, const S& change_Nm) const noexcept {
    return torque_Nm + change_Nm / covered_;
  }

 private:
  S covered_{1.0};
};

}  // namespace abs_hil::control

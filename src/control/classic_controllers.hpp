// Laws that estimate nothing of the tyre: full torque, the maker's relay, PI with the measured tyre force fed forward,
// and a PI controller on slip and deceleration.
#pragma once

#include <cmath>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/law_controller.hpp"
#include "control/slip_error_integral.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Full brake torque: the actuator's largest torque, or b(1) of (7) if the actuator has no limit. `Brake` is a
/// BrakeParameters or a BasicBrake. Real-time safe.
template <class Brake, class S>
[[nodiscard]] S full_torque_Nm(const Brake& brake, const S& max_brake_torque_Nm) noexcept {
  return rig::select(rig::is_finite(max_brake_torque_Nm), max_brake_torque_Nm, rig::brake_torque_at(brake, S(1.0)));
}

/// Full brake torque at any slip: braking without ABS, the reference for the slip controllers. The torque is the
/// actuator's largest, or b(1) of (7) if the actuator has no limit. theta_est_N is NaN.
template <class S>
class LockedLaw {
 public:
  static constexpr bool estimates_theta = false;

  LockedLaw() = default;
  explicit LockedLaw(const ControllerContext& context) noexcept
      : laws_{paper::laws(context.rig.wheels)}, brake_{context.rig.brake} {}

  void reset(const BasicSlipInput<S>& /*input*/) noexcept {}
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    return {.brake_torque_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm),
            .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
            .theta_est_N = rig::unknown};
  }
  void take_over(const LockedLaw& /*before*/) noexcept {}

 private:
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
};

/// Relay as in the rig maker's demonstration: no torque while the slip is above a threshold, otherwise full torque (as
/// LockedLaw). It has no state and so no hysteresis. theta_est_N is NaN.
template <class S>
class RelayLaw {
 public:
  static constexpr bool estimates_theta = false;

  RelayLaw() = default;
  /// Throws std::invalid_argument for a threshold outside [0, 1).
  explicit RelayLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)}, brake_{context.rig.brake}, threshold_{context.options.relay.threshold} {
    rig::require_valid(context.options.relay, "control.relay.");
  }

  void reset(const BasicSlipInput<S>& /*input*/) noexcept {}
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S threshold = rig::select(threshold_ > 0.0, threshold_, input.slip_ref);
    const S full_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm);
    return {.brake_torque_Nm = rig::select(input.slip > threshold, S(0.0), full_Nm),
            .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
            .theta_est_N = rig::unknown};
  }
  void take_over(const RelayLaw& /*before*/) noexcept {}

 private:
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  S threshold_{0.0};
};

/// Brake torque that keeps e_v constant by (14): (J1/r1)(k F + friction drift). The lower wheel's deceleration gives
/// the tyre force F = -(J2 omega2' + d2 omega2 + M20)/r2, taken as >= 0. This needs no tyre model and no theta.
/// Real-time safe.
template <class S>
[[nodiscard]] S measured_equivalent_torque_Nm(const paper::Laws<S>& w, const BasicSlipInput<S>& input) noexcept {
  const paper::Reading<S> now{
      .omega1 = input.speeds.omega1_rad_s, .omega2 = input.speeds.omega2_rad_s, .lambda_ref = input.slip_ref};
  const S tyre_force_N =
      rig::larger(S(0.0), S(-(w.J2 * input.alpha2_rad_s2 + w.d2 * input.speeds.omega2_rad_s + w.M20) / w.r2));
  return w.T_b(w.k(now) * tyre_force_N + w.delta(now));
}

/// Speed-scheduled PI with feed-forward. The slip responds faster to a torque when the car is slower: slip' ~ (r1/J1)
/// Tb/v_x. So the gains on the slip error are proportional to v_x, and the scaled error is e_v = v_x (slip - slip_ref):
///   Tb = feed_forward * (measured equivalent torque) - (J1/r1) ( Kp e_v + ki I ),  I' = e_v,
/// SlipErrorIntegral gives I and its anti-windup. Kp = (1 - exp(-kp h))/h for a period h, so that the proportional part
/// alone reduces e_v by exp(-kp h) in each period at any rate. theta_est_N is NaN.
template <class S>
class PiLaw {
 public:
  static constexpr bool estimates_theta = false;

  PiLaw() = default;
  explicit PiLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        kp_per_s_{-std::expm1(-context.options.pi.kp_per_s / context.options.rate_Hz) * context.options.rate_Hz},
        ki_per_s2_{context.options.pi.ki_per_s2},
        feed_forward_{context.options.pi.feed_forward} {
    if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
    rig::require_valid(context.options.pi, "control.pi.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept {
    integral_.reset(slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref), input.slip_ref);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref);
    integral_.advance(input, error_m_s, input.slip_ref, laws_.r2 * input.speeds.omega2_rad_s);
    const S feedback_m_s2 = -kp_per_s_ * error_m_s - ki_per_s2_ * integral_.value_m();
    const S torque_Nm = feed_forward_ * measured_equivalent_torque_Nm(laws_, input) + laws_.T_b(feedback_m_s2);
    return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = rig::unknown};
  }
  void take_over(const PiLaw& before) noexcept { integral_ = before.integral_; }

 private:
  paper::Laws<S> laws_{};
  S kp_per_s_{0.0};
  S ki_per_s2_{0.0};
  S feed_forward_{0.0};
  BasicSlipErrorIntegral<S> integral_{};
};

/// Mixed slip-deceleration control (Savaresi, Tanelli and Cantoni, 2007): a PI controller holds
///   slip + weight * (deceleration of the upper wheel's circumference in g)
/// at one value. With a constant wheel slip the wheel decelerates as the car does, so the held slip is smaller where
/// the tyre grips more. The deceleration also answers a torque at once, and damps the loop. It estimates nothing.
/// A standing wheel has slip 1 and no deceleration. theta_est_N is NaN.
template <class S>
class MixedSlipDecelerationLaw {
 public:
  static constexpr bool estimates_theta = false;

  MixedSlipDecelerationLaw() = default;
  explicit MixedSlipDecelerationLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        brake_{context.rig.brake},
        options_{context.options.mixed_slip_deceleration} {
    rig::require_valid(options_, "control.mixed_slip_deceleration.");
  }

  void reset(const BasicSlipInput<S>& /*input*/) noexcept { integral_Nm_ = S(0.0); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  void take_over(const MixedSlipDecelerationLaw& before) noexcept { integral_Nm_ = before.integral_Nm_; }

 private:
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  MixedSlipDecelerationOptions<S> options_{};
  S integral_Nm_{0.0};
};

template <class S>
BasicSlipOutput<S> MixedSlipDecelerationLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  constexpr double g_m_s2 = 9.81;
  const S deceleration =
      rig::select(turns(input.speeds.omega1_rad_s), S(-laws_.r1 * input.alpha1_rad_s2 / g_m_s2), S(0.0));
  const S error = options_.target - (input.slip + options_.weight * deceleration);
  const S full_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm);
  // Where less was sent than asked for, the integral must not grow, and the other way round.
  const S integral_Nm = rig::clamped(S(integral_Nm_ + options_.ki_Nm_s * error * input.dt_s), S(0.0), full_Nm);
  integral_Nm_ = rig::select(input.unsent_torque_Nm * error > 0.0, integral_Nm_, integral_Nm);
  return {.brake_torque_Nm = rig::clamped(S(options_.kp_Nm * error + integral_Nm_), S(0.0), full_Nm),
          .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace abs_hil::control

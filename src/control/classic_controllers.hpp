// Laws that estimate nothing of the tyre: full torque, the maker's relay, the paper's (16) for a known peak tyre force,
// PI with the measured tyre force fed forward, a PI controller on slip and deceleration, and production-style logic on
// thresholds of the wheel's acceleration.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
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

/// Slip controller (16) for a known peak tyre force theta0: `nominal_T_b` of paper_laws.hpp in sampled-data form.
/// SlipErrorDynamics gives the torque, and SlipErrorIntegral gives I.
/// With the correct theta0 and an ideal actuator, e_v'' + ks1 e_v' + ks0 e_v = 0. theta_est_N is theta0.
template <class S>
class NominalLaw {
 public:
  static constexpr bool estimates_theta = true;

  NominalLaw() = default;
  explicit NominalLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        tyre_{context.rig.tyre},
        dynamics_{context},
        theta0_N_{context.options.nominal.theta0_N != 0.0 ? context.options.nominal.theta0_N
                                                          : context.rig.tyre.theta_N} {
    rig::require_valid(context.options.nominal, "control.nominal.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept {
    integral_.reset(slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref), input.slip_ref);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref);
    integral_.advance(input, error_m_s, input.slip_ref, laws_.r2 * input.speeds.omega2_rad_s);

    const S phi = rig::normalised_tyre_force(tyre_, input.slip);
    const S torque_Nm = dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta0_N_, phi);
    return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta0_N_};
  }
  void take_over(const NominalLaw& before) noexcept { integral_ = before.integral_; }

 private:
  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  BasicSlipErrorDynamics<S> dynamics_{};
  S theta0_N_{0.0};
  BasicSlipErrorIntegral<S> integral_{};
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

/// State of the cycle of FivePhaseLaw.
enum class BrakePhase : std::uint8_t {
  apply,    ///< first application: the torque rises fast
  hold,     ///< the wheel decelerates more than a car can: the torque is held
  release,  ///< it decelerates even more: the torque falls
  recover,  ///< the wheel accelerates: the torque is held until it has recovered
  reapply,  ///< the torque rises slowly until the next instability
};

/// Anti-lock logic on thresholds of the braked wheel's acceleration a = r1 omega1', as in production systems (the cycle
/// of the Bosch Automotive Handbook; five-phase algorithms after Pasillas-Lepine, 2006). It measures no slip:
/// apply -> hold (a < hold_below) -> release (a < release_below) -> recover (a > recover_above) -> re-apply (a, once
/// above reapply_below, < reapply_below) -> hold ... From hold it re-applies when a is back above hold_below, or
/// after hold_limit_s without a transition. A standing wheel counts as one that decelerates without bound, because
/// nothing else distinguishes a locked wheel from a free one here. The controller reads alpha1, omega1 and the torque's
/// limit only. It reports the slip velocity error for the record. theta_est_N is NaN.
template <class S>
class FivePhaseLaw {
 public:
  static constexpr bool estimates_theta = false;

  FivePhaseLaw() = default;
  /// Throws std::invalid_argument if thresholds are out of order or a ramp or limit is not > 0.
  explicit FivePhaseLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        brake_{context.rig.brake},
        options_{context.options.five_phase},
        period_s_{1.0 / context.options.rate_Hz} {
    rig::require_valid(options_, "control.five_phase.");
    if (!(options_.release_below_m_s2 <= options_.hold_below_m_s2)) {
      throw std::invalid_argument("control.five_phase.release_below_m_s2 must not be above hold_below_m_s2");
    }
    if (!(options_.recover_above_m_s2 > options_.release_below_m_s2)) {
      throw std::invalid_argument("control.five_phase.recover_above_m_s2 must be above release_below_m_s2");
    }
    if (!(options_.reapply_below_m_s2 > options_.hold_below_m_s2)) {
      throw std::invalid_argument("control.five_phase.reapply_below_m_s2 must be above hold_below_m_s2");
    }
    if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  }

  void reset(const BasicSlipInput<S>& /*input*/) noexcept {
    phase_ = number(BrakePhase::apply);
    in_phase_s_ = at_zero_s_ = accelerated_ = torque_Nm_ = S(0.0);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  void take_over(const FivePhaseLaw& before) noexcept {
    phase_ = before.phase_;
    in_phase_s_ = before.in_phase_s_;
    at_zero_s_ = before.at_zero_s_;
    accelerated_ = before.accelerated_;
    torque_Nm_ = before.torque_Nm_;
  }

  [[nodiscard]] BrakePhase phase() const noexcept { return static_cast<BrakePhase>(phase_); }

 private:
  static S number(BrakePhase phase) noexcept { return S(static_cast<double>(phase)); }
  [[nodiscard]] auto in(BrakePhase phase) const noexcept { return phase_ == number(phase); }
  /// @param a_m_s2  acceleration of the wheel
  [[nodiscard]] S next_phase(const S& a_m_s2) const noexcept;
  [[nodiscard]] S ramp_Nm_s() const noexcept;

  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  FivePhaseOptions<S> options_{};
  S period_s_{0.0};
  S phase_{0.0};  ///< the number of a BrakePhase
  S in_phase_s_{0.0};
  S at_zero_s_{0.0};    ///< since the torque reached 0 in `release`
  S accelerated_{0.0};  ///< 1 in `recover` once the acceleration has been above reapply_below, else 0
  S torque_Nm_{0.0};
};

template <class S>
S FivePhaseLaw<S>::next_phase(const S& a_m_s2) const noexcept {
  using enum BrakePhase;
  const auto unstable = a_m_s2 < options_.hold_below_m_s2;
  const auto held_long = in_phase_s_ >= options_.hold_limit_s;
  const auto recovered =
      (accelerated_ > 0.0 && a_m_s2 < options_.reapply_below_m_s2) || in_phase_s_ >= options_.recover_limit_s;
  const auto turned = a_m_s2 > options_.recover_above_m_s2 || at_zero_s_ >= options_.recover_limit_s;

  const S from_apply = rig::select(unstable, number(hold), phase_);
  const S from_hold = rig::select(a_m_s2 < options_.release_below_m_s2, number(release),
                                  rig::select(!unstable || held_long, number(reapply), phase_));
  const S from_release = rig::select(turned, number(recover), phase_);
  const S from_recover = rig::select(unstable, number(hold), rig::select(recovered, number(reapply), phase_));
  return rig::select(in(hold), from_hold,
                     rig::select(in(release), from_release, rig::select(in(recover), from_recover, from_apply)));
}

template <class S>
S FivePhaseLaw<S>::ramp_Nm_s() const noexcept {
  using enum BrakePhase;
  return rig::select(
      in(apply), options_.apply_Nm_s,
      rig::select(in(release), S(-options_.release_Nm_s), rig::select(in(reapply), options_.reapply_Nm_s, S(0.0))));
}

template <class S>
BasicSlipOutput<S> FivePhaseLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  const S unbounded_m_s2 = S(-std::numeric_limits<double>::infinity());
  const S acceleration_m_s2 =
      rig::select(turns(input.speeds.omega1_rad_s), S(laws_.r1 * input.alpha1_rad_s2), unbounded_m_s2);
  const auto accelerates = acceleration_m_s2 > options_.reapply_below_m_s2;
  in_phase_s_ += input.dt_s;
  at_zero_s_ = rig::select(torque_Nm_ > 0.0, S(0.0), S(at_zero_s_ + input.dt_s));
  accelerated_ = rig::select(accelerates, S(1.0), accelerated_);

  const S next = next_phase(acceleration_m_s2);
  const auto changes = next != phase_;
  phase_ = next;
  in_phase_s_ = rig::select(changes, S(0.0), in_phase_s_);
  accelerated_ = rig::select(changes, rig::select(accelerates, S(1.0), S(0.0)), accelerated_);
  // A ramp goes on from what was sent, not from what a limit held back.
  torque_Nm_ = rig::select(input.unsent_torque_Nm != 0.0, input.sent_brake_torque_Nm, torque_Nm_);
  // The torque is held for the next period, so it gets the ramp's value at the period's end.
  const S step_s = rig::select(input.dt_s > 0.0, input.dt_s, period_s_);
  torque_Nm_ =
      rig::clamped(S(torque_Nm_ + ramp_Nm_s() * step_s), S(0.0), full_torque_Nm(brake_, input.max_brake_torque_Nm));
  return {.brake_torque_Nm = torque_Nm_,
          .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace abs_hil::control

// The sliding-mode laws: with the sign of e_v, with a boundary layer, also stepped back through the brake's lag, and
// super-twisting.
#pragma once

#include "abs_hil/rig/option_check.hpp"
#include "control/law_controller.hpp"
#include "control/sliding_surface.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Sliding-mode slip control, the type of the paper's own baseline:
///   Tb = (J1/r1) xi_1 of (18), with nu = -K sign(e_v) - q e_v in place of -ks0 I - ks1 e_v; q is 0 by default,
///   theta_hat' = -gamma k(slip_ref) phi(slip) sign(e_v), projected.
/// The law and the gains of the paper's baseline are not public. This is the textbook law for the error (13), not a
/// copy. The sign is held for a period, so e_v chatters around 0 with an amplitude of about K times the period. The
/// chatter belongs to the law.
template <class S>
class SlidingModeLaw {
 public:
  static constexpr bool estimates_theta = true;

  SlidingModeLaw() = default;
  explicit SlidingModeLaw(const ControllerContext& context)
      : surface_{context, context.options.sliding_mode.adaptation},
        gain_m_s2_{context.options.sliding_mode.gain_m_s2},
        reaching_per_s_{context.options.sliding_mode.reaching_per_s} {
    rig::require_valid(context.options.sliding_mode, "control.sliding_mode.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept { surface_.reset(input); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const S sign = rig::select(error_m_s > 0.0, S(1.0), rig::select(error_m_s < 0.0, S(-1.0), S(0.0)));
    const S rate_m_s2 = -gain_m_s2_ * sign - reaching_per_s_ * error_m_s;
    const BasicWantedMotion<S> wanted{.mean_rate_m_s2 = rate_m_s2,
                                      .error_at_mid_m_s = error_m_s + 0.5 * surface_.period_s() * rate_m_s2};
    return surface_.drive(input, error_m_s, wanted, sign);
  }
  void take_over(const SlidingModeLaw& before) noexcept { surface_.take_over(before.surface_); }

 private:
  BasicSlidingSurface<S> surface_{};
  S gain_m_s2_{0.0};
  S reaching_per_s_{0.0};
};

/// Closed-form solution e_v of e_v' = -K sat(e_v/width) after `time_s`. |e_v| falls at the rate K outside the boundary
/// layer of that width, and exponentially inside it. Real-time safe.
template <class S>
[[nodiscard]] S boundary_layer_motion_m_s(const S& error_m_s, const S& gain_m_s2, const S& width_m_s,
                                          const S& time_s) noexcept {
  const S size = rig::magnitude(error_m_s);
  const S outside_s = rig::larger(S(0.0), S((size - width_m_s) / gain_m_s2));
  const S inside_s = time_s - outside_s;
  const S outside = size - gain_m_s2 * time_s;
  const S inside = rig::smaller(size, width_m_s) * rig::exponential(S(-gain_m_s2 / width_m_s * inside_s));
  return rig::with_sign(rig::select(time_s <= outside_s, outside, inside), error_m_s);
}

/// The motion of e_v over a period, by that solution. Real-time safe.
template <class S>
[[nodiscard]] BasicWantedMotion<S> boundary_layer_reference(const S& error_m_s, const S& gain_m_s2, const S& width_m_s,
                                                            const S& period_s) noexcept {
  const S error_at_end_m_s = boundary_layer_motion_m_s(error_m_s, gain_m_s2, width_m_s, period_s);
  return {.mean_rate_m_s2 = (error_at_end_m_s - error_m_s) / period_s,
          .error_at_mid_m_s = boundary_layer_motion_m_s(error_m_s, gain_m_s2, width_m_s, S(0.5 * period_s))};
}

/// SlidingModeLaw with a boundary layer: sat(e_v/width) replaces sign(e_v), so that the torque is continuous in e_v.
/// The law of the paper's own sliding-mode baseline is not public. In sampled form the mean of e_v' over a period is
/// that of the closed-form solution above. This is stable for any width and rate. For width -> 0 it becomes the
/// implicit (backward Euler) form of the sign, which does not chatter.
template <class S>
class SmoothSlidingModeLaw {
 public:
  static constexpr bool estimates_theta = true;

  SmoothSlidingModeLaw() = default;
  explicit SmoothSlidingModeLaw(const ControllerContext& context)
      : surface_{context, context.options.sliding_mode_smooth.adaptation},
        gain_m_s2_{context.options.sliding_mode_smooth.gain_m_s2},
        width_m_s_{context.options.sliding_mode_smooth.boundary_m_s} {
    rig::require_valid(context.options.sliding_mode_smooth, "control.sliding_mode_smooth.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept { surface_.reset(input); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const BasicWantedMotion<S> wanted =
        boundary_layer_reference(error_m_s, gain_m_s2_, width_m_s_, surface_.period_s());
    return surface_.drive(input, error_m_s, wanted, S(-wanted.mean_rate_m_s2 / gain_m_s2_));
  }
  void take_over(const SmoothSlidingModeLaw& before) noexcept { surface_.take_over(before.surface_); }

 private:
  BasicSlidingSurface<S> surface_{};
  S gain_m_s2_{0.0};
  S width_m_s_{0.0};
};

/// One period of the super-twisting algorithm e' = -k1 sqrt|e| sign(e) + z, z' = -k2 sign(e).
template <class S>
struct SuperTwistingStep {
  S root_rate_m_s2{0.0};  ///< -k1 sqrt|e| sign(e), mean over the period
  S integral_m_s2{0.0};   ///< z for the period
  S sign{0.0};            ///< substitute for sign(e), in [-1, 1]
};

/// Semi-implicit step. sqrt|e| is taken at the period's end, where e+ = e - h k1 sqrt|e+| sign(e+). The sign is
/// sat(e/(h^2 k2)), so that the change of z never takes e beyond 0. The step is continuous in e and z. Close to 0 it
/// becomes the deadbeat pair u = z - 2 e/h, z+ = z - e/h. This ends the chatter at any rate and leaves e = O(h^2) under
/// a perturbation of bounded slope (docs/theory-baselines.md). Real-time safe.
template <class S>
[[nodiscard]] SuperTwistingStep<S> super_twisting_step(const S& error_m_s, const S& integral_m_s2, const S& k1,
                                                       const S& k2, const S& period_s) noexcept {
  const S& h = period_s;
  const S size = rig::magnitude(error_m_s);
  // sqrt|e+| of |e+| + h k1 sqrt|e+| = |e|, without the cancellation of -b + sqrt(b^2 + 4|e|).
  const S root = 2.0 * size / (h * k1 + rig::square_root(S(h * h * k1 * k1 + 4.0 * size)));
  const S sign = rig::clamped(S(error_m_s / (h * h * k2)), S(-1.0), S(1.0));
  return {.root_rate_m_s2 = rig::with_sign(S(k1 * root), S(-error_m_s)),
          .integral_m_s2 = integral_m_s2 - h * k2 * sign,
          .sign = sign};
}

/// Super-twisting slip control: the equivalent control of SlidingModeLaw, but with the continuous
///   -k1 sqrt|e_v| sign(e_v) + z,  z' = -k2 sign(e_v)
/// in place of -K sign(e_v). The law overcomes a model error rho with |rho'| <= L in finite time if k2 > L and
/// k1 > sqrt(k2 + L). z is held while the reference torque is outside the actuator's range and z would drive it further
/// out.
template <class S>
class SuperTwistingLaw {
 public:
  static constexpr bool estimates_theta = true;

  SuperTwistingLaw() = default;
  explicit SuperTwistingLaw(const ControllerContext& context)
      : surface_{context, context.options.super_twisting.adaptation},
        k1_{context.options.super_twisting.k1},
        k2_{context.options.super_twisting.k2} {
    rig::require_valid(context.options.super_twisting, "control.super_twisting.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept {
    surface_.reset(input);
    integral_m_s2_ = S(0.0);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const S period_s = surface_.period_s();
    const SuperTwistingStep<S> next = super_twisting_step(error_m_s, integral_m_s2_, k1_, k2_, period_s);
    // z compensates the model error, so only the root moves e_v.
    const BasicWantedMotion<S> wanted{.mean_rate_m_s2 = next.root_rate_m_s2 + next.integral_m_s2,
                                      .error_at_mid_m_s = error_m_s + 0.5 * period_s * next.root_rate_m_s2};
    const BasicSlipOutput<S> output = surface_.drive(input, error_m_s, wanted, next.sign);
    const auto held = surface_.winds_up(S(next.integral_m_s2 - integral_m_s2_));
    integral_m_s2_ = rig::select(held, integral_m_s2_, next.integral_m_s2);
    return output;
  }
  void take_over(const SuperTwistingLaw& before) noexcept {
    surface_.take_over(before.surface_);
    integral_m_s2_ = before.integral_m_s2_;
  }

 private:
  BasicSlidingSurface<S> surface_{};
  S k1_{0.0};
  S k2_{0.0};
  S integral_m_s2_{0.0};
};

/// SmoothSlidingModeLaw stepped back through the brake's lag (6), as AdaptiveActuatorLaw does with (17): alpha is the
/// torque of the sliding-mode law, and eta = (r1/J1)(Tb - alpha) is the error that the lag leaves, in m/s^2. The static
/// torque reference is
///   b = Tb + (1/c31) ( alpha' - (J1/r1) lag_gain eta ),
/// with alpha' from the model at theta_hat, so eta' = -lag_gain eta and e_v' = -K sat(e_v/width) + eta - k phi
/// theta_err. The speeds are those of a force observer, which the brake torque is fed to. With an ideal actuator (no
/// limit, no lag) the output equals that of SmoothSlidingModeLaw with the same gains, bit for bit
/// (docs/theory-baselines.md).
template <class S>
class SlidingModeActuatorLaw {
 public:
  static constexpr bool estimates_theta = true;

  SlidingModeActuatorLaw() = default;
  explicit SlidingModeActuatorLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        tyre_{context.rig.tyre},
        lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
        surface_{context, context.options.sliding_mode_actuator.adaptation},
        wheels_observer_{context.options.sliding_mode_actuator.observer, context.rig, context.options.rate_Hz},
        gain_m_s2_{context.options.sliding_mode_actuator.gain_m_s2},
        width_m_s_{context.options.sliding_mode_actuator.boundary_m_s},
        lag_decay_per_s_{
            rig::exponential_less_one(-context.options.sliding_mode_actuator.lag_gain_per_s / context.options.rate_Hz) *
            context.options.rate_Hz},
        gamma_{context.options.sliding_mode_actuator.adaptation.gamma},
        v_min_m_s_{context.options.v_min_m_s} {
    rig::require_valid(context.options.sliding_mode_actuator, "control.sliding_mode_actuator.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept {
    surface_.reset(input);
    wheels_observer_.reset(input.speeds);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& raw) noexcept;
  void take_over(const SlidingModeActuatorLaw& before) noexcept {
    surface_.take_over(before.surface_);
    wheels_observer_.take_over(before.wheels_observer_);
  }

 private:
  [[nodiscard]] S through_lag(const BasicSlipInput<S>& input, const BasicSlipOutput<S>& wanted,
                              const S& switching) const noexcept;
  [[nodiscard]] S reference_rate_m_s3(const BasicSlipInput<S>& input, const S& error_m_s, const S& theta_N,
                                      const S& switching) const noexcept;

  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  BasicBrakeLag<S> lag_{};
  BasicSlidingSurface<S> surface_{};
  BasicWheelForceObserver<S> wheels_observer_{};
  S gain_m_s2_{0.0};
  S width_m_s_{0.0};
  S lag_decay_per_s_{0.0};  ///< mean rate of eta / eta over the period: -lag_gain for h -> 0
  S gamma_{0.0};
  S v_min_m_s_{0.0};
};

template <class S>
BasicSlipOutput<S> SlidingModeActuatorLaw<S>::step(const BasicSlipInput<S>& raw) noexcept {
  const auto lags = rig::is_finite(raw.max_brake_torque_Nm);
  if (rig::any(lags)) wheels_observer_.update(raw);
  const BasicSlipInput<S> input = with_speeds(raw, lags, wheels_observer_.speeds(), laws_, v_min_m_s_);
  const S error_m_s = surface_.observe(input);
  const BasicWantedMotion<S> wanted = boundary_layer_reference(error_m_s, gain_m_s2_, width_m_s_, surface_.period_s());
  const S switching = -wanted.mean_rate_m_s2 / gain_m_s2_;
  BasicSlipOutput<S> output = surface_.drive(input, error_m_s, wanted, switching);
  if (rig::any(lags))
    output.brake_torque_Nm = rig::select(lags, through_lag(input, output, switching), output.brake_torque_Nm);
  return output;
}

template <class S>
S SlidingModeActuatorLaw<S>::through_lag(const BasicSlipInput<S>& input, const BasicSlipOutput<S>& wanted,
                                         const S& switching) const noexcept {
  const S arm = laws_.J1 / laws_.r1;
  const S eta = (input.brake_torque_Nm - wanted.brake_torque_Nm) / arm;
  const S rate = reference_rate_m_s3(input, wanted.slip_velocity_error_m_s, wanted.theta_est_N, switching) +
                 lag_decay_per_s_ * eta;
  return lag_.command_Nm(input.brake_torque_Nm, S(surface_.period_s() * arm * rate));
}

/// (r1/J1) alpha' by the model at theta_hat.
template <class S>
S SlidingModeActuatorLaw<S>::reference_rate_m_s3(const BasicSlipInput<S>& input, const S& error_m_s, const S& theta_N,
                                                 const S& switching) const noexcept {
  const S phi = rig::normalised_tyre_force(tyre_, input.slip);
  const S k = laws_.k({.lambda_ref = input.slip_ref});
  const WheelMotion<S> motion =
      wheel_motion(laws_, input.speeds, input.slip, input.slip_ref,
                   {.tyre_force_N = theta_N * phi, .brake_torque_Nm = input.brake_torque_Nm}, v_min_m_s_);
  const auto inside = rig::magnitude(error_m_s) < width_m_s_;
  const S wanted_rate = rig::select(inside, S(-gain_m_s2_ / width_m_s_ * motion.error_rate_m_s2), S(0.0));
  const S theta_rate_N_s = -gamma_ * k * phi * switching;
  return wanted_rate + k * phi * theta_rate_N_s +
         k * theta_N * rig::normalised_tyre_force_slope(tyre_, input.slip) * motion.slip_rate_per_s +
         motion.drift_rate_m_s3;
}

}  // namespace abs_hil::control

// The sliding mode with a boundary layer, stepped back through the brake's lag.
#pragma once

#include "abs_hil/rig/option_check.hpp"
#include "control/law_controller.hpp"
#include "control/sliding_mode_controllers.hpp"
#include "control/sliding_surface.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

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

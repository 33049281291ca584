// The adaptive law (17)-(18) stepped back through the brake's lag, also with gains that follow from its dead time.
#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/law_controller.hpp"
#include "control/slip_error_integral.hpp"
#include "control/state_predictor.hpp"
#include "control/theta_estimator.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// The adaptive controller (17)-(18) with the brake's lag (6) as a third step of backstepping (docs/theory-beyond.md):
/// alpha is the torque of (17), and eta = (r1/J1)(Tb - alpha) is the error that the lag leaves, in m/s^2. The static
/// torque reference,
///   b = Tb + (1/c31) ( alpha' - (J1/r1) ( lag_gain eta + B'P [I; e_v] / lag_weight ) ),
/// with alpha' from the model at theta_hat, and the tuning function zeta' = -gamma phi ( k B'P [I; e_v] + lag_weight a
/// eta ) give V' = -x'Qx - lag_weight lag_gain eta^2 - ka1 phi theta_err^2 for
///   V = ( x'Px + lag_weight eta^2 + theta_err^2 / gamma ) / 2.
/// While the command is limited, the integral is held and only the innovation adapts theta_hat. With an ideal actuator
/// (no limit, no lag) the output equals that of AdaptiveLaw with the same gains, bit for bit.
template <class S>
class AdaptiveActuatorLaw {
 public:
  static constexpr bool estimates_theta = true;

  AdaptiveActuatorLaw() = default;
  /// Throws std::invalid_argument for gains, Q or bounds of theta out of range.
  explicit AdaptiveActuatorLaw(const ControllerContext& context);

  void reset(const BasicSlipInput<S>& input) noexcept;
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& raw) noexcept;
  void take_over(const AdaptiveActuatorLaw& before) noexcept;

 private:
  [[nodiscard]] BasicSlipInput<S> acting(const BasicSlipInput<S>& now) const noexcept;
  [[nodiscard]] S gain(const S& slip) const noexcept { return laws_.k({.lambda_ref = slip}); }
  template <class Condition>
  void adapt(const BasicSlipInput<S>& input, const S& past_phi, const Condition& lags) noexcept;
  [[nodiscard]] S zeta_rate_N_s(const S& slip_ref, const S& phi, const S& BtP_x) const noexcept;
  [[nodiscard]] S through_lag(const BasicSlipInput<S>& input, const S& wanted_Nm, const S& error_m_s) noexcept;
  [[nodiscard]] S wanted_rate_m_s3(const BasicSlipInput<S>& input, const S& error_m_s,
                                   const S& zeta_rate) const noexcept;
  [[nodiscard]] S wanted_rate_per_theta(const BasicSlipInput<S>& input) const noexcept;

  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  BasicBrakeLag<S> lag_{};
  BasicStatePredictor<S> predictor_{};
  S lag_decay_per_s_{0.0};  ///< mean rate of eta / eta over the period: -lag_gain for h -> 0
  S lag_weight_{0.0};       ///< s^2
  S v_min_m_s_{0.0};
  S period_s_{0.0};
  BasicSlipErrorDynamics<S> dynamics_{};
  paper::Gains<S> gains_{};
  BasicSlipErrorIntegral<S> measured_{};  ///< of (17)
  BasicSlipErrorIntegral<S> integral_{};  ///< of (18): the same, at the state that the law acts on
  BasicThetaEstimator<S> theta_{};
  BasicWheelForceObserver<S> wheels_observer_{};
  S omega1_rad_s_{0.0};  ///< of the previous cycle, as is the slip
  S slip_{0.0};
  S tuning_{0.0};   ///< lag_weight a eta of the previous cycle
  S limited_{0.0};  ///< 1 if the previous command was not sent as it was, else 0
};

template <class S>
void AdaptiveActuatorLaw<S>::reset(const BasicSlipInput<S>& input) noexcept {
  measured_.reset(slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref), input.slip_ref);
  integral_ = measured_;
  theta_.reset();
  wheels_observer_.reset(input.speeds);
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
  tuning_ = S(0.0);
}

template <class S>
BasicSlipOutput<S> AdaptiveActuatorLaw<S>::step(const BasicSlipInput<S>& raw) noexcept {
  const auto lags = rig::is_finite(raw.max_brake_torque_Nm);
  limited_ = rig::select(lags && raw.unsent_torque_Nm != 0.0, S(1.0), S(0.0));
  if (rig::any(lags)) wheels_observer_.update(raw);
  const BasicSlipInput<S> now = with_speeds(raw, lags, wheels_observer_.speeds(), laws_, v_min_m_s_);
  measured_.advance(now, slip_velocity_error_m_s(laws_, now.speeds, now.slip_ref), now.slip_ref,
                    laws_.r2 * now.speeds.omega2_rad_s);
  const BasicSlipInput<S> input = acting(now);
  const S error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref);
  integral_.advance(input, error_m_s, input.slip_ref, laws_.r2 * input.speeds.omega2_rad_s);
  const S past_phi = rig::normalised_tyre_force(tyre_, S(0.5 * (slip_ + now.slip)));
  adapt(now, past_phi, lags);

  S torque_Nm =
      dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta_.theta_N(), past_phi);
  if (rig::any(lags)) torque_Nm = rig::select(lags, through_lag(input, torque_Nm, error_m_s), torque_Nm);
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta_.theta_N()};
}

/// What the law acts on: the state as a torque that is sent now begins to act. Only the innovation is of now.
template <class S>
BasicSlipInput<S> AdaptiveActuatorLaw<S>::acting(const BasicSlipInput<S>& now) const noexcept {
  if (now.ahead.torques_Nm.empty()) return now;
  const ActingState<S> state =
      predictor_(now.ahead, {now.speeds, now.brake_torque_Nm}, wheels_observer_.brake_error_Nm(), [&](const S& slip) {
        return CurvePoint<S>{theta_.theta_N() * rig::normalised_tyre_force(tyre_, slip),
                             theta_.theta_N() * rig::normalised_tyre_force_slope(tyre_, slip)};
      });
  BasicSlipInput<S> result = with_speeds(now, !rig::is_nan(now.slip), state.speeds, laws_, v_min_m_s_);
  result.brake_torque_Nm = state.brake_torque_Nm;
  return result;
}

/// zeta' = -gamma phi ( k B'P [I; e_v] + lag_weight a eta ); 0 while the command is limited.
template <class S>
S AdaptiveActuatorLaw<S>::zeta_rate_N_s(const S& slip_ref, const S& phi, const S& BtP_x) const noexcept {
  return rig::select(limited_ > 0.0, S(0.0), S(-gains_.gamma * phi * (gain(slip_ref) * BtP_x + tuning_)));
}

template <class S>
template <class Condition>
void AdaptiveActuatorLaw<S>::adapt(const BasicSlipInput<S>& input, const S& past_phi, const Condition& lags) noexcept {
  const S BtP_x = paper::Laws<S>::BtP_x(gains_, measured_.mean_value_m(), measured_.mean_error_m_s());
  const S zeta_rate = zeta_rate_N_s(input.slip_ref, past_phi, BtP_x);
  if (rig::any(lags)) {
    const auto known = turns(omega1_rad_s_) && turns(input.speeds.omega1_rad_s) && input.dt_s > 0.0;
    theta_.update_where(
        known,
        {.dt_s = input.dt_s, .tyre_force_N = wheels_observer_.force_N(), .phi = past_phi, .zeta_rate_N_s = zeta_rate});
  } else {
    theta_.update(BasicAdaptationInterval<S>{.dt_s = input.dt_s,
                                             .omega1_before_rad_s = omega1_rad_s_,
                                             .omega1_after_rad_s = input.speeds.omega1_rad_s,
                                             .brake_torque_Nm = input.mean_brake_torque_Nm,
                                             .phi = past_phi,
                                             .zeta_rate_N_s = zeta_rate});
  }
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
}

/// (r1/J1) alpha' of (17) by the model at theta_hat. `zeta_rate` is the part of theta_hat' that is known now.
template <class S>
S AdaptiveActuatorLaw<S>::wanted_rate_m_s3(const BasicSlipInput<S>& input, const S& error_m_s,
                                           const S& zeta_rate) const noexcept {
  const S phi = rig::normalised_tyre_force(tyre_, input.slip);
  const S k = gain(input.slip_ref);
  const WheelMotion<S> motion =
      wheel_motion(laws_, input.speeds, input.slip, input.slip_ref,
                   {.tyre_force_N = theta_.theta_N() * phi, .brake_torque_Nm = input.brake_torque_Nm}, v_min_m_s_);
  return paper::Laws<S>::nu(gains_, error_m_s, motion.error_rate_m_s2) + k * phi * zeta_rate +
         k * theta_.theta_N() * rig::normalised_tyre_force_slope(tyre_, input.slip) * motion.slip_rate_per_s +
         motion.drift_rate_m_s3;
}

/// Effect on it of each newton of phi (theta - theta_hat), which the model does not know: the factor a of the header.
template <class S>
S AdaptiveActuatorLaw<S>::wanted_rate_per_theta(const BasicSlipInput<S>& input) const noexcept {
  const auto& w = laws_;
  const S k = gain(input.slip_ref);
  const S phi = rig::larger(S(0.0), rig::normalised_tyre_force(tyre_, input.slip));
  const S v_x = rig::larger(S(w.r2 * input.speeds.omega2_rad_s), v_min_m_s_);
  const S slip_rate = -gain(input.slip) / v_x;
  const S upper = w.r1 / w.J1;
  const S lower = w.r2 / w.J2;
  const S drift_rate = -upper * upper * w.d1 - (1.0 - input.slip_ref) * lower * lower * w.d2;
  return gains_.ks1 * k + k * phi * gains_.gamma * gains_.ka1 +
         k * theta_.theta_N() * rig::normalised_tyre_force_slope(tyre_, input.slip) * slip_rate + drift_rate;
}

template <class S>
S AdaptiveActuatorLaw<S>::through_lag(const BasicSlipInput<S>& input, const S& wanted_Nm, const S& error_m_s) noexcept {
  const S arm = laws_.J1 / laws_.r1;
  const S eta = (input.brake_torque_Nm - wanted_Nm) / arm;
  const S BtP_x = paper::Laws<S>::BtP_x(gains_, integral_.value_m(), error_m_s);
  const S phi = rig::larger(S(0.0), rig::normalised_tyre_force(tyre_, input.slip));

  tuning_ = lag_weight_ * wanted_rate_per_theta(input) * eta;
  const S zeta_rate = zeta_rate_N_s(input.slip_ref, phi, BtP_x);
  const S eta_rate = lag_decay_per_s_ * eta - BtP_x / lag_weight_;
  const S torque_rate_Nm_s = arm * (wanted_rate_m_s3(input, error_m_s, zeta_rate) + eta_rate);
  return lag_.command_Nm(input.brake_torque_Nm, S(period_s_ * torque_rate_Nm_s));
}

template <class S>
void AdaptiveActuatorLaw<S>::take_over(const AdaptiveActuatorLaw& before) noexcept {
  measured_ = before.measured_;
  integral_ = before.integral_;
  theta_.take_over(before.theta_);
  wheels_observer_.take_over(before.wheels_observer_);
  omega1_rad_s_ = before.omega1_rad_s_;
  slip_ = before.slip_;
  tuning_ = before.tuning_;
}

/// AdaptiveActuatorLaw, which acts on the predicted state, with gains by the rule of `predicted_gains` in place of
/// Table 1's: ks1 is the largest gain of the slip and ks0 = ks1^2/4, so that e_v returns fastest without overshoot,
/// and `lag_gain_per_s` is the largest gain of the torque. Below a dead time of 16 ms they stay as
/// they are there, since the observer's own delay counts, too. It has no keys of its own: the rig's file makes it
/// usable. With a right model (17) and (18) hold at t + Td, but theta_hat is that of t (docs/theory-beyond.md).
template <class S>
class AdaptivePredictorLaw : public AdaptiveActuatorLaw<S> {
 public:
  AdaptivePredictorLaw() = default;
  /// Throws std::invalid_argument as AdaptiveActuatorLaw does.
  explicit AdaptivePredictorLaw(const ControllerContext& context);
};

}  // namespace abs_hil::control

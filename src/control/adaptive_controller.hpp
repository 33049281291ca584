// The paper's adaptive law (17)-(18).
#pragma once

#include <array>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/law_controller.hpp"
#include "control/slip_error_integral.hpp"
#include "control/theta_estimator.hpp"

namespace abs_hil::control {

/// Adaptive slip control (17)-(18) of Theorem 3.1, `adaptive_T_b` and `adaptive_dot` of paper_laws.hpp in
/// sampled-data form. SlipErrorDynamics gives the torque, SlipErrorIntegral gives I, and ThetaEstimator gives
/// theta_hat. The estimator uses the brake torque that acts, not the reference. With an ideal actuator V = ([I; e_v]' P
/// [I; e_v] + (theta - theta_hat)^2/gamma)/2 never grows.
template <class S>
class AdaptiveLaw {
 public:
  static constexpr bool estimates_theta = true;

  AdaptiveLaw() = default;
  /// Throws std::invalid_argument for gains, Q or bounds of theta out of range.
  explicit AdaptiveLaw(const ControllerContext& context);

  void reset(const BasicSlipInput<S>& input) noexcept;
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  void take_over(const AdaptiveLaw& before) noexcept;
  /// The states of (17), and V and V' of Theorem 3.1. V needs the true theta: these take the model's, so V falls as the
  /// theorem says only if the model's theta is right.
  static constexpr std::array<rig::Signal, 5> signals{{
      {"I_m", "integral of the slip velocity error, I of (17), in m"},
      {"omega1_hat_rad_s", "upper wheel's speed in the estimator of (17), in rad/s"},
      {"zeta_N", "zeta of (17), in N"},
      {"V", "Lyapunov function of Theorem 3.1, with the model's theta"},
      {"V_dot", "its derivative V' by the theorem, with the model's theta and phi of the past interval"},
  }};
  void show(SlipOutput& output) const noexcept;

 private:
  void adapt(const BasicSlipInput<S>& input) noexcept;

  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  S theta_model_N_{0.0};
  BasicSlipErrorDynamics<S> dynamics_{};
  paper::Gains<S> gains_{};
  paper::Weights<S> weights_{};
  BasicSlipErrorIntegral<S> integral_{};
  BasicThetaEstimator<S> theta_{};
  S omega1_rad_s_{0.0};  ///< of the previous cycle, as is the slip
  S slip_{0.0};
  S past_phi_{0.0};
};

template <class S>
void AdaptiveLaw<S>::reset(const BasicSlipInput<S>& input) noexcept {
  integral_.reset(slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref), input.slip_ref);
  theta_.reset();
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
}

template <class S>
BasicSlipOutput<S> AdaptiveLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  const S error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref);
  integral_.advance(input, error_m_s, input.slip_ref, laws_.r2 * input.speeds.omega2_rad_s);
  // phi at the mean of the two slips has half the error of the trapezoidal rule where the curvature of phi is largest.
  past_phi_ = rig::normalised_tyre_force(tyre_, S(0.5 * (slip_ + input.slip)));
  adapt(input);

  const S torque_Nm =
      dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta_.theta_N(), past_phi_);
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta_.theta_N()};
}

template <class S>
void AdaptiveLaw<S>::adapt(const BasicSlipInput<S>& input) noexcept {
  const S BtP_x = paper::Laws<S>::BtP_x(gains_, integral_.mean_value_m(), integral_.mean_error_m_s());
  theta_.update({.dt_s = input.dt_s,
                 .omega1_before_rad_s = omega1_rad_s_,
                 .omega1_after_rad_s = input.speeds.omega1_rad_s,
                 .brake_torque_Nm = input.mean_brake_torque_Nm,
                 .phi = past_phi_,
                 .zeta_rate_N_s = laws_.zeta_dot(gains_, {.lambda_ref = input.slip_ref, .phi = past_phi_}, BtP_x)});
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
}

template <class S>
void AdaptiveLaw<S>::take_over(const AdaptiveLaw& before) noexcept {
  integral_ = before.integral_;
  theta_.take_over(before.theta_);
  omega1_rad_s_ = before.omega1_rad_s_;
  slip_ = before.slip_;
}

}  // namespace abs_hil::control

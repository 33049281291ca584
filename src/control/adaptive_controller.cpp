#include "control/adaptive_controller.hpp"

#include <array>

#include "abs_hil/rig/tyre_curve.hpp"
#include "control/adaptive_gains.hpp"

namespace abs_hil::control {

AdaptiveController::AdaptiveController(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      tyre_{context.rig.tyre},
      dynamics_{context},
      gains_{paper_gains(context.options.adaptive)},
      weights_{paper_weights(context.options.adaptive)},
      theta_{context.options.adaptive, context.rig.wheels} {}

void AdaptiveController::reset(const SlipInput& input) noexcept {
  integral_.reset(slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref), input.slip_ref);
  theta_.reset();
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
}

SlipOutput AdaptiveController::step(const SlipInput& input) noexcept {
  const double error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref);
  integral_.advance(input, error_m_s, input.slip_ref, wheels_.r2_m * input.speeds.omega2_rad_s);
  // phi at the mean of the two slips has half the error of the trapezoidal rule where the curvature of phi is largest.
  const double past_phi = rig::normalised_tyre_force(tyre_, 0.5 * (slip_ + input.slip));
  adapt(input, past_phi);

  const double torque_Nm =
      dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta_.theta_N(), past_phi);
  return {.brake_torque_Nm = torque_Nm,
          .slip_velocity_error_m_s = error_m_s,
          .theta_est_N = theta_.theta_N(),
          .signals = states(error_m_s, past_phi)};
}

std::span<const rig::Signal> AdaptiveController::signals() const noexcept {
  static constexpr std::array<rig::Signal, 5> rows{{
      {"I_m", "integral of the slip velocity error, I of (17), in m"},
      {"omega1_hat_rad_s", "upper wheel's speed in the estimator of (17), in rad/s"},
      {"zeta_N", "zeta of (17), in N"},
      {"V", "Lyapunov function of Theorem 3.1, with the model's theta"},
      {"V_dot", "its derivative V' by the theorem, with the model's theta and phi of the past interval"},
  }};
  return rows;
}

/// In the order of `signals`.
rig::SignalValues AdaptiveController::states(double error_m_s, double phi) const noexcept {
  using Laws = paper::Laws<double>;
  const double I = integral_.value_m();
  const double theta_err_N = tyre_.theta_N - theta_.theta_N();
  return {I, theta_.omega1_hat_rad_s(omega1_rad_s_), theta_.zeta_N(),
          Laws::V(gains_, weights_, I, error_m_s, theta_err_N),
          Laws::V_dot(gains_, weights_, I, error_m_s, phi, theta_err_N)};
}

void AdaptiveController::adapt(const SlipInput& input, double past_phi) noexcept {
  const paper::Laws<double> laws = paper::laws(wheels_);
  const double BtP_x = paper::Laws<double>::BtP_x(gains_, integral_.mean_value_m(), integral_.mean_error_m_s());
  theta_.update({.dt_s = input.dt_s,
                 .omega1_before_rad_s = omega1_rad_s_,
                 .omega1_after_rad_s = input.speeds.omega1_rad_s,
                 .brake_torque_Nm = input.mean_brake_torque_Nm,
                 .phi = past_phi,
                 .zeta_rate_N_s = laws.zeta_dot(gains_, {.lambda_ref = input.slip_ref, .phi = past_phi}, BtP_x)});
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
}

bool AdaptiveController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const AdaptiveController*>(&before);
  if (other == nullptr) return false;
  integral_ = other->integral_;
  theta_.take_over(other->theta_);
  omega1_rad_s_ = other->omega1_rad_s_;
  slip_ = other->slip_;
  return true;
}

}  // namespace abs_hil::control

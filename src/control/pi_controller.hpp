// PI on the slip, scheduled with the speed, with the measured tyre force fed forward.
#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/law_controller.hpp"
#include "control/slip_error_integral.hpp"

namespace abs_hil::control {

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
  /// Throws std::invalid_argument for options out of range.
  explicit PiLaw(const ControllerContext& context)
    requires std::is_same_v<S, double>;

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

class PiController final : public LawController<PiLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control

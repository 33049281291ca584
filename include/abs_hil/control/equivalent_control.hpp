#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

/// The reference motion of e_v during the next period.
template <class S>
struct BasicWantedMotion {
  S mean_rate_m_s2{0.0};    ///< mean of e_v' over the period
  S error_at_mid_m_s{0.0};  ///< e_v in the middle of the period
};
using WantedMotion = BasicWantedMotion<double>;

/// Equivalent control, the common part of all slip laws. By (14) the torque for a reference motion of e_v is
/// Tb = (J1/r1) xi_1, where nu is the reference e_v' (`xi_1` and `T_b` of paper_laws.hpp).
/// The torque is held for a period, so the terms that cancel the plant's own motion are taken in the middle of the
/// period: phi changes by a quarter within 1 ms when braking starts. The model predicts the slip there along the
/// reference motion. No measurement is differentiated, so the prediction does not amplify noise.
template <class S>
class BasicEquivalentControl {
 public:
  BasicEquivalentControl() = default;
  /// Throws std::invalid_argument if the control rate or v_min_m_s is not > 0.
  explicit BasicEquivalentControl(const ControllerContext& context);

  /// @param error_m_s  e_v of `input`
  /// @param theta_N  peak tyre force, known or estimated
  /// @param recent_phi  phi(slip), now or half a cycle ago: v_x is predicted with it, and changes little
  /// @return brake torque to hold for one period, N m; may lie outside what the actuator can give. Real-time safe.
  [[nodiscard]] S brake_torque_Nm(const BasicSlipInput<S>& input, const S& error_m_s,
                                  const BasicWantedMotion<S>& wanted, const S& theta_N,
                                  const S& recent_phi) const noexcept;

  [[nodiscard]] S period_s() const noexcept { return 2.0 * half_period_s_; }

 private:
  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  S v_min_m_s_{0.0};
  S half_period_s_{0.0};
};
using EquivalentControl = BasicEquivalentControl<double>;

template <class S>
S BasicEquivalentControl<S>::brake_torque_Nm(const BasicSlipInput<S>& input, const S& error_m_s,
                                             const BasicWantedMotion<S>& wanted, const S& theta_N,
                                             const S& recent_phi) const noexcept {
  const auto& w = laws_;
  // Prediction for the middle of the period: e_v on the reference trajectory, v_x by (9).
  const S v_x = w.r2 * input.speeds.omega2_rad_s;
  const S v_x_rate = -w.r2 / w.J2 * (w.r2 * theta_N * recent_phi + w.d2 * input.speeds.omega2_rad_s + w.M20);
  const S v_x_mid = v_x + half_period_s_ * v_x_rate;
  // slip = slip_ref + e_v/v_x by (12)-(13). Only the change is predicted, so that h -> 0 gives the measured slip.
  const S slip_mid = input.slip + wanted.error_at_mid_m_s / rig::larger(v_x_mid, v_min_m_s_) -
                     error_m_s / rig::larger(v_x, v_min_m_s_);
  const paper::Reading<S> mid{.omega1 = ((1.0 - input.slip_ref) * v_x_mid - wanted.error_at_mid_m_s) / w.r1,
                              .omega2 = v_x_mid / w.r2,
                              .lambda_ref = input.slip_ref,
                              .phi = rig::normalised_tyre_force(tyre_, slip_mid)};
  return w.T_b(w.xi_1(mid, wanted.mean_rate_m_s2, theta_N));
}

}  // namespace abs_hil::control

#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// The reference motion of e_v during the next period.
struct WantedMotion {
  double mean_rate_m_s2{0.0};    ///< mean of e_v' over the period
  double error_at_mid_m_s{0.0};  ///< e_v in the middle of the period
};

/// Equivalent control, the common part of all slip laws. By (14) the torque for a reference motion of e_v is
/// Tb = (J1/r1) xi_1, where nu is the reference e_v' (`xi_1` and `T_b` of paper_laws.hpp).
/// The torque is held for a period, so the terms that cancel the plant's own motion are taken in the middle of the
/// period: phi changes by a quarter within 1 ms when braking starts. The model predicts the slip there along the
/// reference motion. No measurement is differentiated, so the prediction does not amplify noise.
class EquivalentControl {
 public:
  /// Throws std::invalid_argument if the control rate or v_min_m_s is not > 0.
  explicit EquivalentControl(const ControllerContext& context);

  /// @param error_m_s  e_v of `input`
  /// @param theta_N  peak tyre force, known or estimated
  /// @param recent_phi  phi(slip), now or half a cycle ago: v_x is predicted with it, and changes little
  /// @return brake torque to hold for one period, N m; may lie outside what the actuator can give. Real-time safe.
  [[nodiscard]] double brake_torque_Nm(const SlipInput& input, double error_m_s, const WantedMotion& wanted,
                                       double theta_N, double recent_phi) const noexcept;

  [[nodiscard]] double period_s() const noexcept { return 2.0 * half_period_s_; }

 private:
  paper::Laws<double> laws_;
  rig::TyreParameters tyre_;
  double v_min_m_s_;
  double half_period_s_;
};

}  // namespace abs_hil::control

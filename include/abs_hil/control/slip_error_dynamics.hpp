#pragma once

#include <Eigen/Core>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "control/equivalent_control.hpp"

namespace abs_hil::control {

/// Slip velocity error (13), e_v = (1 - slip_ref) r2 omega2 - r1 omega1. Real-time safe.
[[nodiscard]] constexpr double slip_velocity_error_m_s(const rig::WheelParameters& w, const rig::WheelSpeeds& speeds,
                                                       double slip_ref) noexcept {
  return (1.0 - slip_ref) * w.r2_m * speeds.omega2_rad_s - w.r1_m * speeds.omega1_rad_s;
}

/// The part of e_v' in (14) that bearing friction causes, with the sign in which (16) cancels it, m/s^2:
/// -(r1/J1)(d1 omega1 + M10) + (1 - slip_ref)(r2/J2)(d2 omega2 + M20). Both wheels turn forwards. Real-time safe.
[[nodiscard]] constexpr double friction_drift_m_s2(const rig::WheelParameters& w, const rig::WheelSpeeds& speeds,
                                                   double slip_ref) noexcept {
  return -w.r1_m / w.J1_kg_m2 * (w.d1_Nms_rad * speeds.omega1_rad_s + w.M10_Nm) +
         (1.0 - slip_ref) * w.r2_m / w.J2_kg_m2 * (w.d2_Nms_rad * speeds.omega2_rad_s + w.M20_Nm);
}

/// A of the error dynamics [I; e_v]' = A [I; e_v] that the control law imposes: e_v'' + ks1 e_v' + ks0 e_v = 0.
[[nodiscard]] Eigen::Matrix2d error_dynamics_matrix(double ks0, double ks1);

/// The control law common to (16) and (17)-(18): brake torque
///   Tb = (J1/r1) ( -ks0 I - ks1 e_v + k(slip_ref) theta phi(slip) + friction drift ),
/// in sampled-data form, because the torque is held for a whole period h and the paper's law is in continuous time.
/// - The first two terms, the wanted e_v', become the mean of e_v' over the period along the wanted trajectory: row 2
///   of (exp(A h) - 1)/h times [I; e_v]. So e_v meets that trajectory at every tick whatever the rate; for h -> 0 it is
///   the printed law.
/// - The other terms, which cancel what the plant does by itself, are EquivalentControl's.
class SlipErrorDynamics {
 public:
  /// Throws std::invalid_argument for ks0, ks1, the control rate or v_min_m_s not > 0.
  explicit SlipErrorDynamics(const ControllerContext& context);

  /// @param integral_m  I, integral of e_v
  /// @param error_m_s  e_v of `input`
  /// @param theta_N  peak tyre force, known or estimated
  /// @param recent_phi  phi(slip), now or half a cycle ago: v_x is predicted with it, and changes little
  /// @return brake torque to hold for one period, N m; may lie outside what the actuator can give. Real-time safe.
  [[nodiscard]] double brake_torque_Nm(const SlipInput& input, double integral_m, double error_m_s, double theta_N,
                                       double recent_phi) const noexcept;

 private:
  EquivalentControl equivalent_;
  Eigen::RowVector2d mean_rate_;     ///< row 2 of (exp(A h) - 1)/h, 1/s^2 and 1/s
  Eigen::RowVector2d error_at_mid_;  ///< row 2 of exp(A h/2): e_v in the middle of the period
};

}  // namespace abs_hil::control

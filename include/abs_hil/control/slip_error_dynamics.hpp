#pragma once

#include <Eigen/Core>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/equivalent_control.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// Slip velocity error (13), e_v = (1 - slip_ref) r2 omega2 - r1 omega1. Real-time safe.
[[nodiscard]] constexpr double slip_velocity_error_m_s(const rig::WheelParameters& w, const rig::WheelSpeeds& speeds,
                                                       double slip_ref) noexcept {
  return paper::laws(w).e_v({.omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = slip_ref});
}

template <class S>
[[nodiscard]] constexpr S slip_velocity_error_m_s(const paper::Laws<S>& laws, const rig::BasicWheelSpeeds<S>& speeds,
                                                  const S& slip_ref) noexcept {
  return laws.e_v({.omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = slip_ref});
}

/// A of the error dynamics [I; e_v]' = A [I; e_v] that the control law imposes: e_v'' + ks1 e_v' + ks0 e_v = 0.
[[nodiscard]] Eigen::Matrix2d error_dynamics_matrix(double ks0, double ks1);

/// The feedback-linearising law of (16) and (18), `nominal_T_b` and `adaptive_T_b` of paper_laws.hpp, in sampled-data
/// form: the torque is held for a whole period h, but the paper's law is in continuous time.
/// - nu, the reference e_v', becomes the mean of e_v' over the period along the reference trajectory: row 2 of
///   (exp(A h) - 1)/h times [I; e_v]. This row is -[ks0 ks1] for h -> 0. So e_v meets the trajectory at every tick for
///   any rate.
/// - EquivalentControl computes the other terms, which cancel the plant's own motion.
template <class S>
class BasicSlipErrorDynamics {
 public:
  BasicSlipErrorDynamics() = default;
  /// Throws std::invalid_argument if ks0, ks1, the control rate or v_min_m_s is not > 0.
  explicit BasicSlipErrorDynamics(const ControllerContext& context);

  /// Tb of (16) for theta0, of (17)-(18) for theta_hat.
  /// @param integral_m  I, integral of e_v
  /// @param error_m_s  e_v of `input`
  /// @param theta_N  theta0 or theta_hat
  /// @param recent_phi  phi(slip), now or half a cycle ago: v_x is predicted with it, and changes little
  /// @return brake torque to hold for one period, N m; may lie outside what the actuator can give. Real-time safe.
  [[nodiscard]] S feedback_linearising_torque_Nm(const BasicSlipInput<S>& input, const S& integral_m,
                                                 const S& error_m_s, const S& theta_N,
                                                 const S& recent_phi) const noexcept {
    const BasicWantedMotion<S> wanted{
        .mean_rate_m_s2 = paper::Laws<S>::nu(sampled_gains_, integral_m, error_m_s),
        .error_at_mid_m_s = error_at_mid_.per_s * integral_m + error_at_mid_.share * error_m_s};
    return equivalent_.brake_torque_Nm(input, error_m_s, wanted, theta_N, recent_phi);
  }

 private:
  /// Row 2 of exp(A h/2): it gives e_v in the middle of the period from I and e_v.
  struct ErrorAtMid {
    S per_s{0.0};
    S share{0.0};
  };

  BasicEquivalentControl<S> equivalent_{};
  paper::Gains<S> sampled_gains_{};  ///< ks0, ks1 such that nu is the mean: -row 2 of (exp(A h) - 1)/h
  ErrorAtMid error_at_mid_{};
};
using SlipErrorDynamics = BasicSlipErrorDynamics<double>;

}  // namespace abs_hil::control

#include "abs_hil/control/slip_error_dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unsupported/Eigen/MatrixFunctions>

#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

Eigen::Matrix2d error_dynamics_matrix(double ks0, double ks1) {
  Eigen::Matrix2d A;
  A << 0.0, 1.0, -ks0, -ks1;
  return A;
}

SlipErrorDynamics::SlipErrorDynamics(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      tyre_{context.rig.tyre},
      v_min_m_s_{context.options.v_min_m_s},
      half_period_s_{0.5 / context.options.rate_Hz} {
  const auto& gains = context.options.adaptive;
  const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  if (!positive(gains.ks0) || !positive(gains.ks1)) throw std::invalid_argument("ks0 and ks1 must be > 0");
  if (!positive(context.options.rate_Hz)) throw std::invalid_argument("the control rate must be > 0");
  if (!positive(v_min_m_s_)) throw std::invalid_argument("v_min_m_s must be > 0");

  const Eigen::Matrix2d A = error_dynamics_matrix(gains.ks0, gains.ks1);
  const Eigen::Matrix2d half = (A * half_period_s_).exp();
  const Eigen::Matrix2d whole = half * half;
  mean_rate_ = (whole - Eigen::Matrix2d::Identity()).row(1) / (2.0 * half_period_s_);
  error_at_mid_ = half.row(1);
}

double SlipErrorDynamics::brake_torque_Nm(const SlipInput& input, double integral_m, double error_m_s, double theta_N,
                                          double recent_phi) const noexcept {
  const auto& w = wheels_;
  const double wanted_rate = mean_rate_[0] * integral_m + mean_rate_[1] * error_m_s;

  // In the middle of the period: e_v on the wanted trajectory, v_x by (9).
  const double error_mid = error_at_mid_[0] * integral_m + error_at_mid_[1] * error_m_s;
  const double v_x = w.r2_m * input.speeds.omega2_rad_s;
  const double v_x_rate =
      -w.r2_m / w.J2_kg_m2 * (w.r2_m * theta_N * recent_phi + w.d2_Nms_rad * input.speeds.omega2_rad_s + w.M20_Nm);
  const double v_x_mid = v_x + half_period_s_ * v_x_rate;
  // slip = slip_ref + e_v/v_x by (12)-(13); only its change is predicted, so that h -> 0 leaves the measured slip.
  const double slip_mid =
      input.slip + error_mid / std::max(v_x_mid, v_min_m_s_) - error_m_s / std::max(v_x, v_min_m_s_);
  const rig::WheelSpeeds speeds_mid{.omega1_rad_s = ((1.0 - input.slip_ref) * v_x_mid - error_mid) / w.r1_m,
                                    .omega2_rad_s = v_x_mid / w.r2_m};

  const double tyre_part =
      rig::slip_velocity_gain(w, input.slip_ref) * theta_N * rig::normalised_tyre_force(tyre_, slip_mid);
  const double friction_part = friction_drift_m_s2(w, speeds_mid, input.slip_ref);
  return w.J1_kg_m2 / w.r1_m * (wanted_rate + tyre_part + friction_part);
}

}  // namespace abs_hil::control

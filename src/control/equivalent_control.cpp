#include "abs_hil/control/equivalent_control.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

EquivalentControl::EquivalentControl(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      tyre_{context.rig.tyre},
      v_min_m_s_{context.options.v_min_m_s},
      half_period_s_{0.5 / context.options.rate_Hz} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("the control rate must be > 0");
  rig::require_valid(context.options, &ControlOptions::v_min_m_s, "control.");
}

double EquivalentControl::brake_torque_Nm(const SlipInput& input, double error_m_s, const WantedMotion& wanted,
                                          double theta_N, double recent_phi) const noexcept {
  const auto& w = wheels_;
  // In the middle of the period: e_v on the wanted trajectory, v_x by (9).
  const double v_x = w.r2_m * input.speeds.omega2_rad_s;
  const double v_x_rate =
      -w.r2_m / w.J2_kg_m2 * (w.r2_m * theta_N * recent_phi + w.d2_Nms_rad * input.speeds.omega2_rad_s + w.M20_Nm);
  const double v_x_mid = v_x + half_period_s_ * v_x_rate;
  // slip = slip_ref + e_v/v_x by (12)-(13); only its change is predicted, so that h -> 0 leaves the measured slip.
  const double slip_mid =
      input.slip + wanted.error_at_mid_m_s / std::max(v_x_mid, v_min_m_s_) - error_m_s / std::max(v_x, v_min_m_s_);
  const rig::WheelSpeeds speeds_mid{
      .omega1_rad_s = ((1.0 - input.slip_ref) * v_x_mid - wanted.error_at_mid_m_s) / w.r1_m,
      .omega2_rad_s = v_x_mid / w.r2_m};

  const double tyre_part =
      rig::slip_velocity_gain(w, input.slip_ref) * theta_N * rig::normalised_tyre_force(tyre_, slip_mid);
  const double friction_part = friction_drift_m_s2(w, speeds_mid, input.slip_ref);
  return w.J1_kg_m2 / w.r1_m * (wanted.mean_rate_m_s2 + tyre_part + friction_part);
}

}  // namespace abs_hil::control

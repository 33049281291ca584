#include "abs_hil/control/equivalent_control.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

EquivalentControl::EquivalentControl(const ControllerContext& context)
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      v_min_m_s_{context.options.v_min_m_s},
      half_period_s_{0.5 / context.options.rate_Hz} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  rig::require_valid(context.options, &ControlOptions::v_min_m_s, "control.");
}

double EquivalentControl::brake_torque_Nm(const SlipInput& input, double error_m_s, const WantedMotion& wanted,
                                          double theta_N, double recent_phi) const noexcept {
  const auto& w = laws_;
  // Prediction for the middle of the period: e_v on the reference trajectory, v_x by (9).
  const double v_x = w.r2 * input.speeds.omega2_rad_s;
  const double v_x_rate = -w.r2 / w.J2 * (w.r2 * theta_N * recent_phi + w.d2 * input.speeds.omega2_rad_s + w.M20);
  const double v_x_mid = v_x + half_period_s_ * v_x_rate;
  // slip = slip_ref + e_v/v_x by (12)-(13). Only the change is predicted, so that h -> 0 gives the measured slip.
  const double slip_mid =
      input.slip + wanted.error_at_mid_m_s / std::max(v_x_mid, v_min_m_s_) - error_m_s / std::max(v_x, v_min_m_s_);
  const paper::Reading<double> mid{.omega1 = ((1.0 - input.slip_ref) * v_x_mid - wanted.error_at_mid_m_s) / w.r1,
                                   .omega2 = v_x_mid / w.r2,
                                   .lambda_ref = input.slip_ref,
                                   .phi = rig::normalised_tyre_force(tyre_, slip_mid)};
  return w.T_b(w.xi_1(mid, wanted.mean_rate_m_s2, theta_N));
}

}  // namespace abs_hil::control

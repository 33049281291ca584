#include "abs_hil/control/wheel_motion.hpp"

#include <algorithm>
#include <cmath>

#include "abs_hil/control/paper_laws.hpp"

namespace abs_hil::control {

WheelMotion wheel_motion(const rig::WheelParameters& w, const rig::WheelSpeeds& speeds, double slip, double slip_ref,
                         const WheelLoads& loads, double v_min_m_s) noexcept {
  WheelMotion motion;
  motion.omega1_rate_rad_s2 =
      (w.r1_m * loads.tyre_force_N - w.d1_Nms_rad * speeds.omega1_rad_s - w.M10_Nm - loads.brake_torque_Nm) /
      w.J1_kg_m2;
  motion.omega2_rate_rad_s2 =
      (-w.r2_m * loads.tyre_force_N - w.d2_Nms_rad * speeds.omega2_rad_s - w.M20_Nm) / w.J2_kg_m2;
  const double upper_m_s2 = w.r1_m * motion.omega1_rate_rad_s2;
  const double lower_m_s2 = w.r2_m * motion.omega2_rate_rad_s2;
  const double v_x = std::max(w.r2_m * speeds.omega2_rad_s, v_min_m_s);
  motion.error_rate_m_s2 = paper::Laws<double>::e_v_dot(slip_ref, lower_m_s2, upper_m_s2);
  motion.slip_rate_per_s = ((1.0 - slip) * lower_m_s2 - upper_m_s2) / v_x;
  motion.drift_rate_m_s3 = -w.r1_m / w.J1_kg_m2 * w.d1_Nms_rad * motion.omega1_rate_rad_s2 +
                           (1.0 - slip_ref) * w.r2_m / w.J2_kg_m2 * w.d2_Nms_rad * motion.omega2_rate_rad_s2;
  return motion;
}

BrakeLag::BrakeLag(double c31_per_s, double period_s) noexcept : covered_{-std::expm1(-c31_per_s * period_s)} {}

}  // namespace abs_hil::control

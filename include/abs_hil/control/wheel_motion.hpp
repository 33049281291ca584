#pragma once

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// The controller's estimate of the loads on the wheels.
struct WheelLoads {
  double tyre_force_N{0.0};
  double brake_torque_Nm{0.0};
};

/// Rates of the wheels and their slip under given loads, by (1), (2), (5) and (13).
struct WheelMotion {
  double omega1_rate_rad_s2{0.0};
  double omega2_rate_rad_s2{0.0};
  double error_rate_m_s2{0.0};  ///< e_v' at a constant slip reference
  double slip_rate_per_s{0.0};  ///< of (5)
  double drift_rate_m_s3{0.0};  ///< of `friction_drift_m_s2`
};

/// @param slip  slip at `speeds`
/// @param v_min_m_s  the slip's rate divides by at least this car speed, > 0
/// Both wheels turn forwards. Real-time safe.
[[nodiscard]] WheelMotion wheel_motion(const rig::WheelParameters& wheels, const rig::WheelSpeeds& speeds, double slip,
                                       double slip_ref, const WheelLoads& loads, double v_min_m_s) noexcept;

/// The brake's lag (6) for a torque that is held over a period.
class BrakeLag {
 public:
  /// @param c31_per_s, period_s  > 0
  BrakeLag(double c31_per_s, double period_s) noexcept;

  /// Static torque b to hold for one period so that the torque changes by `change_Nm`: it covers 1 - exp(-c31 h) of the
  /// distance to b. For h -> 0 this is Tb + Tb'/c31. May lie outside what the actuator can give. Real-time safe.
  [[nodiscard]] double command_Nm(double torque_Nm, double change_Nm) const noexcept {
    return torque_Nm + change_Nm / covered_;
  }

 private:
  double covered_;
};

}  // namespace abs_hil::control

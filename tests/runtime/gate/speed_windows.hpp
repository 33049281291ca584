#pragma once

#include "runtime/encoder_check.hpp"

/// Inputs of the tests of EncoderCheck: speed windows of 2 ms from encoders of 4,096 counts.
namespace abs_hil::runtime::test {

inline constexpr double dt_s = 0.002;
inline constexpr double resolution_rad_s = 2.0 * 6.283185307179586 / 4096.0 / dt_s;

inline PlausibilityLimits limits() {
  return plausibility_limits({}, false, {.overspeed_rad_s = 250.0, .free_slip_max = 0.15});
}

inline SpeedWindow speed_window(double omega1_rad_s, double omega2_rad_s, double brake_Nm = 0.0) {
  return {.dt_s = dt_s,
          .omega1_rad_s = omega1_rad_s,
          .omega2_rad_s = omega2_rad_s,
          .resolution_rad_s = resolution_rad_s,
          .brake_target_Nm = brake_Nm};
}

/// The first fault in `count` speed windows at these speeds.
inline CheckResult run(EncoderCheck& check, int count, double omega1_rad_s, double omega2_rad_s,
                       double brake_Nm = 0.0) {
  for (int i = 0; i < count; ++i) {
    const CheckResult found = check.update(speed_window(omega1_rad_s, omega2_rad_s, brake_Nm));
    if (!found.sound()) return found;
  }
  return {};
}

}  // namespace abs_hil::runtime::test

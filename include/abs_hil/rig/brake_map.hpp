#pragma once

#include <algorithm>

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::rig {

/// Static brake torque b(u) of (7), N m, for a duty u in [0, 1]; 0 inside the dead zone. Real-time safe.
[[nodiscard]] constexpr double brake_torque_at(const BrakeParameters& brake, double duty) noexcept {
  return duty >= brake.u0 ? std::max(0.0, brake.b1_Nm * duty + brake.b2_Nm) : 0.0;
}

/// Inverse of b(u): the duty in [0, max_duty] whose static torque is nearest to `torque_Nm`. The dead zone makes
/// torques between 0 and b(u0) unreachable; those nearer to 0 give duty 0. Real-time safe.
[[nodiscard]] constexpr double brake_duty_for(const BrakeParameters& brake, double torque_Nm,
                                              double max_duty = 1.0) noexcept {
  const double least_Nm = brake_torque_at(brake, brake.u0);
  if (torque_Nm <= 0.0 || torque_Nm < 0.5 * least_Nm) return 0.0;
  const double duty = std::max(brake.u0, (torque_Nm - brake.b2_Nm) / brake.b1_Nm);
  return std::min(duty, max_duty);
}

}  // namespace abs_hil::rig

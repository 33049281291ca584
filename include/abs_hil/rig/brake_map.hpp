#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "abs_hil/rig/duty_grid.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::rig {

/// Static brake torque b(u) of (7), N m, for a duty u in [0, 1]; 0 inside the dead zone. Real-time safe.
[[nodiscard]] constexpr double brake_torque_at(const BrakeParameters& brake, double duty) noexcept {
  return duty >= brake.u0 ? std::max(0.0, brake.b1_Nm * duty + brake.b2_Nm) : 0.0;
}

/// Inverse of b(u) onto the duties that a PWM of `duty_steps` steps can give (0: any): the duty in [0, max_duty] whose
/// static torque is nearest to `torque_Nm`. It never lies inside the dead zone: torques between 0 and that of the first
/// duty at or above u0 are unreachable, and those nearer to 0 give duty 0. NaN for a torque that is not finite, so that
/// the command gate refuses it. Real-time safe.
[[nodiscard]] constexpr double brake_duty_for(const BrakeParameters& brake, double torque_Nm, double max_duty = 1.0,
                                              std::uint32_t duty_steps = 0) noexcept {
  constexpr double largest = std::numeric_limits<double>::max();
  if (!(torque_Nm >= -largest && torque_Nm <= largest)) return std::numeric_limits<double>::quiet_NaN();
  const double least = duty_at_least(brake.u0, duty_steps);
  const double most = duty_at_most(max_duty, duty_steps);
  if (torque_Nm <= 0.0 || torque_Nm < 0.5 * brake_torque_at(brake, least)) return 0.0;
  if (most < least) return 0.0;  // the whole range lies inside the dead zone
  const double duty = (torque_Nm - brake.b2_Nm) / brake.b1_Nm;
  if (duty <= least) return least;
  return duty >= most ? most : nearest_duty(duty, duty_steps);
}

}  // namespace abs_hil::rig

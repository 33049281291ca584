#pragma once

#include <cmath>

#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::control {

/// Full brake torque: the actuator's largest torque, or b(1) of (7) if the actuator has no limit. Real-time safe.
[[nodiscard]] inline double full_torque_Nm(const rig::BrakeParameters& brake, double max_brake_torque_Nm) noexcept {
  return std::isinf(max_brake_torque_Nm) ? rig::brake_torque_at(brake, 1.0) : max_brake_torque_Nm;
}

}  // namespace abs_hil::control

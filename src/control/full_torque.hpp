// The brake's full torque.
#pragma once

#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::control {

/// Full brake torque: the actuator's largest torque, or b(1) of (7) if the actuator has no limit. `Brake` is a
/// BrakeParameters or a BasicBrake. Real-time safe.
template <class Brake, class S>
[[nodiscard]] S full_torque_Nm(const Brake& brake, const S& max_brake_torque_Nm) noexcept {
  return rig::select(rig::is_finite(max_brake_torque_Nm), max_brake_torque_Nm, rig::brake_torque_at(brake, S(1.0)));
}

}  // namespace abs_hil::control

// An angle brought within half a turn of 0.
#pragma once

#include <numbers>

#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// The same direction within half a turn of 0: sines of angles that grow for ever lose digits. Real-time safe.
template <class S>
[[nodiscard]] S within_half_turn_rad(const S& angle_rad) noexcept {
  constexpr double turn_rad = 2.0 * std::numbers::pi;
  return angle_rad - turn_rad * rig::round_down(S(angle_rad / turn_rad + 0.5));
}

}  // namespace abs_hil::control

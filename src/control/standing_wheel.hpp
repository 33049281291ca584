// Whether a wheel turns, as far as an encoder can tell.
#pragma once

namespace abs_hil::control {

/// Below this speed an encoder cannot tell a turning wheel from a standing one.
inline constexpr double standing_rad_s = 1.0;

/// On a wheel that does not turn, brake and friction hold each other, and the motion says nothing about the tyre force.
/// Real-time safe.
template <class S>
[[nodiscard]] constexpr auto turns(const S& omega_rad_s) noexcept {
  return omega_rad_s >= standing_rad_s;
}

}  // namespace abs_hil::control

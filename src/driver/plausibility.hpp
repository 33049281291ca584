#pragma once

#include <cmath>
#include <cstdint>

#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::driver {

/// False if a duty is not in [0, 1], the torque is < 0, or a value is not finite.
[[nodiscard]] inline bool in_range(const rig::Command& command) noexcept {
  const auto is_duty = [](double value) { return value >= 0.0 && value <= 1.0; };  // false for NaN
  return is_duty(command.motor_duty) && is_duty(command.brake_duty) && std::isfinite(command.brake_torque_Nm) &&
         command.brake_torque_Nm >= 0.0;
}

/// Most counts that a counter can move in `elapsed_ns`, which is >= 0, at a speed of at most `speed_rad_s`.
[[nodiscard]] inline double most_plausible_counts(std::int64_t elapsed_ns, double speed_rad_s,
                                                  std::int32_t counts_per_rev) noexcept {
  /// Counts allowed in addition to what the speed explains, because of vibration, late reads and delays on a bus.
  constexpr double slack_counts = 256.0;
  return slack_counts +
         speed_rad_s * static_cast<double>(elapsed_ns) * rig::s_per_ns / rig::radians_per_count(counts_per_rev);
}

/// True if a counter can have moved from `before` to `after` in `elapsed_ns`, which is >= 0.
/// @param speed_rad_s largest plausible speed
[[nodiscard]] inline bool plausible_travel(std::int32_t before, std::int32_t after, std::int64_t elapsed_ns,
                                           double speed_rad_s, std::int32_t counts_per_rev) noexcept {
  return std::abs(static_cast<double>(rig::counts_between(before, after))) <=
         most_plausible_counts(elapsed_ns, speed_rad_s, counts_per_rev);
}

}  // namespace abs_hil::driver

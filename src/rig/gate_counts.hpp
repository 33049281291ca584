#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// Interventions of the command gate. Only append rows, because summaries contain the names.
enum class GateAction : std::uint8_t {
  passed = 0,
  motor_clamped,           ///< outside [0, gate.motor_duty_max]
  brake_clamped,           ///< outside [0, gate.brake_duty_max]
  motor_blocked_by_brake,  ///< motor and brake must not act together unless the plan permits it: the brake has priority
  motor_blocked_by_disable,  ///< motor duty without motor_enable
  refused,                   ///< the gate sent the safe command instead and latched a fault
  motor_rate_limited,        ///< rose faster than gate.motor_rate_per_s
  brake_rate_limited,        ///< rose faster than gate.brake_rate_per_s
  motor_blocked_by_phase,    ///< no motor in this phase's plan
  brake_blocked_by_phase,    ///< no brake in this phase's plan
};
inline constexpr std::size_t gate_action_count = 10;

/// Number of each intervention. One command may cause several.
using GateCounts = std::array<std::uint64_t, gate_action_count>;

[[nodiscard]] constexpr std::string_view name_of(GateAction action) noexcept {
  constexpr std::array<std::string_view, gate_action_count> names{
      "passed",  "motor_clamped",      "brake_clamped",      "motor_blocked_by_brake", "motor_blocked_by_disable",
      "refused", "motor_rate_limited", "brake_rate_limited", "motor_blocked_by_phase", "brake_blocked_by_phase"};
  return names[static_cast<std::size_t>(action)];
}

/// Commands that the gate changed.
[[nodiscard]] constexpr std::uint64_t interventions(const GateCounts& counts) noexcept {
  std::uint64_t sum = 0;
  for (std::size_t i = 1; i < counts.size(); ++i) sum += counts[i];
  return sum;
}

}  // namespace abs_hil::rig

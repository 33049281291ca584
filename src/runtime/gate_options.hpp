#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/rig/phase.hpp"

namespace abs_hil::runtime {

/// Limits for every command to the rig, from any source. docs/safety.md gives the reason for each default.
struct GateOptions {
  double motor_duty_max{1.0};     ///< in (0, 1]
  double brake_duty_max{1.0};     ///< in (0, 1]; the maker's driver caps the real brake at 0.7
  double overspeed_rad_s{250.0};  ///< a higher speed of either wheel latches a fault, > 0
  double supply_min_V{0.0};       ///< a lower supply voltage latches a fault, >= 0; 0: never
  /// A higher temperature latches a fault, deg C. This project chose the default: the board's own limit is not public.
  double temperature_max_C{90.0};
  double motor_rate_per_s{2000.0};  ///< fastest rise of the drive's duty, 1/s, > 0; falling is never limited
  double brake_rate_per_s{2000.0};  ///< fastest rise of the brake's duty, 1/s, > 0
  double sample_age_max_s{0.02};    ///< longest time without a fresh measurement before a fault latches, > 0
  double free_slip_max{0.15};       ///< largest relative speed difference of the wheels with the brake released, > 0
};

/// Which actuators a phase allows.
struct PhasePermission {
  bool motor{false};
  bool brake{false};
  bool together{false};  ///< motor and brake at once
};

/// One entry for each rig::Phase.
inline constexpr std::size_t phase_count = 7;
using PhasePermissions = std::array<PhasePermission, phase_count>;

/// Motor or brake in any phase, but never both: for runs without a sequence of phases.
[[nodiscard]] constexpr PhasePermissions any_phase() noexcept {
  PhasePermissions all{};
  all.fill({.motor = true, .brake = true});
  return all;
}

}  // namespace abs_hil::runtime

#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/rig/option.hpp"
#include "abs_hil/rig/phase.hpp"

namespace abs_hil::runtime {

/// Limits for every command to the rig, from any source. docs/safety.md gives the reason for each default.
struct GateOptions {
  ABS_HIL_OPTIONS(GateOptions);
  ABS_HIL_OPTION(double, motor_duty_max, 1.0, .meaning = "largest drive PWM that may reach the rig",
                 .range = rig::positive(1), .safety = rig::no_effect_on_safety);
  /// The maker's driver caps the real brake at 0.7.
  ABS_HIL_OPTION(double, brake_duty_max, 1.0, .meaning = "largest brake PWM that may reach the rig",
                 .range = rig::positive(1), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, overspeed_rad_s, 250.0, .unit = "rad/s", .meaning = "speed of either wheel that is a fault",
                 .range = rig::positive(2000), .safety = rig::weaker_above(250));
  ABS_HIL_OPTION(double, supply_min_V, 0.0, .unit = "V",
                 .meaning = "a board that reports a lower supply is a fault; 0 V always is",
                 .range = rig::from_zero(100), .safety = rig::no_effect_on_safety);
  /// The default is ours: the board's own limit is not public.
  ABS_HIL_OPTION(double, temperature_max_C, 90.0, .unit = "deg C", .meaning = "a board that reports more is a fault",
                 .range = rig::positive(300), .safety = rig::weaker_above(90));
  /// Falling is never limited.
  ABS_HIL_OPTION(double, motor_rate_per_s, 2000.0, .unit = "1/s", .meaning = "fastest rise of the drive PWM",
                 .range = rig::positive(1e6), .safety = rig::weaker_above(2000));
  ABS_HIL_OPTION(double, brake_rate_per_s, 2000.0, .unit = "1/s",
                 .meaning = "fastest rise of the brake PWM, from u0 if it is lower: of the brake torque by b1",
                 .range = rig::positive(1e6), .safety = rig::weaker_above(2000));
  ABS_HIL_OPTION(double, sample_age_max_s, 0.02, .unit = "s",
                 .meaning = "so long without a fresh measurement is a fault", .range = rig::between(0.002, 1),
                 .safety = rig::weaker_above(0.05, "blind_control"));
  ABS_HIL_OPTION(double, judge_within_s, 0.1, .unit = "s",
                 .meaning = "so long without a verdict of the wheels' checks, an output on, is a fault",
                 .range = rig::between(0.02, 1), .safety = rig::weaker_above(0.1));
  /// Never above `brake_duty_max`. Faults of brake, board, driver, guardian or time release the brake all the same.
  ABS_HIL_OPTION(double, fault_brake_duty, 0.0,
                 .meaning = "brake PWM from a fault to standstill, unless brake or board are at fault; 0: released",
                 .range = rig::from_zero(1), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, fault_brake_limit_s, 5.0, .unit = "s", .meaning = "... but no longer than this",
                 .range = rig::positive(60), .safety = rig::weaker_above(5));
  ABS_HIL_OPTION(double, free_slip_max, 0.15,
                 .meaning = "share by which the wheels may differ, brake long released, before it is a fault",
                 .range = rig::between(0.02, 1), .safety = rig::weaker_above(0.15));
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

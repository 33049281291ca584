// The options of the CAN node and its entry in the registry.

#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/board_rows.hpp"

namespace abs_hil::driver::can {

/// Everything below `driver.can.` in the configuration.
struct CanOptions {
  ABS_HIL_OPTIONS(CanOptions);
  /// "unix:PATH": a socket of type SOCK_SEQPACKET that an emulator listens on.
  ABS_HIL_OPTION(std::string, interface, "can0",
                 .meaning = "CAN interface of the node; unix:PATH: an emulator's socket in its place",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::string, fd, "auto", .meaning = "CAN FD frames; auto: where interface and node have them",
                 .allowed = {"auto", "on", "off"}, .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::int32_t, watchdog_ms, 20, .unit = "ms",
                 .meaning = "the node zeroes its outputs so long after the last valid command",
                 .range = rig::between(5, 10'000), .safety = rig::weaker_above(50, "outputs_on_after_death"));
  ABS_HIL_OPTION(std::int32_t, answer_timeout_us, 0, .unit = "us",
                 .meaning = "longest wait for the node's answer, at most 80 % of the period; 0: 60 % of it",
                 .range = rig::from_zero(8000), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, motor_duty_max, 1.0, motor_duty_cap);
  /// The vendor's driver caps the brake's supply current at this.
  ABS_HIL_OPTION(double, brake_duty_max, 0.7, brake_duty_cap);
  ABS_HIL_OPTION(std::int32_t, lower_sign, 1, .meaning = "1, or -1 if the counter counts down going forward",
                 .range = rig::between(-1, 1), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, upper_sign, 1, .meaning = "1, or -1 if the counter counts down going forward",
                 .range = rig::between(-1, 1), .safety = rig::commissioned);
  // Of the leaky bucket.
  ABS_HIL_OPTION(std::int32_t, loss_cost, 2, .meaning = "points that a lost or wrong frame costs",
                 .range = rig::from_zero(1000), .safety = rig::weaker_below(2));
  ABS_HIL_OPTION(std::int32_t, loss_relief, 1, .meaning = "points that a good answer takes off",
                 .range = rig::from_zero(1000), .safety = rig::weaker_above(1));
  ABS_HIL_OPTION(std::int32_t, loss_limit, 10, .meaning = "points that end the run",
                 .range = rig::between(1, 1'000'000), .safety = rig::weaker_above(10));
  ABS_HIL_OPTION(double, plausible_speed_rad_s, 1000.0, plausible_speed);
  // Known from elsewhere in the configuration.
  std::int32_t encoder_counts_per_rev{4096};
  double rate_Hz{1000.0};  ///< cycles per second
};

/// The registry's entry for driver.kind=can.
[[nodiscard]] Backend can_backend();

}  // namespace abs_hil::driver::can

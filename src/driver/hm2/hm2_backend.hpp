// The options of a HostMot2 board and its entry in the registry.

#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/board_rows.hpp"

namespace abs_hil::driver::hm2 {

/// Everything below `driver.hm2.` in the configuration. The defaults fit the stock firmware `G540x2` of a 7I92.
struct Hm2Options {
  ABS_HIL_OPTIONS(Hm2Options);
  ABS_HIL_OPTION(std::string, address, "192.168.1.121:27181", .meaning = "the board's IPv4 address, or address:port",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::int32_t, watchdog_ms, 20, .unit = "ms",
                 .meaning = "the board drops all outputs so long after the last command", .range = rig::between(5, 20),
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, drive_pwm, 0, .meaning = "PWM instance of the drive", .range = rig::between(0, 31),
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, brake_pwm, 1, .meaning = "PWM instance of the brake", .range = rig::between(0, 31),
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, drive_pin, 1,
                 .meaning = "I/O pin at which the board must have the drive's PWM; -1: any one",
                 .range = rig::between(-1, 255), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, brake_pin, 18,
                 .meaning = "I/O pin at which the board must have the brake's PWM; -1: any one",
                 .range = rig::between(-1, 255), .safety = rig::commissioned);
  ABS_HIL_OPTION(bool, active_low, true,
                 .meaning = "the outputs are inverted: a pin that is pulled high is off (docs/hm2.md)",
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(double, pwm_frequency_Hz, 160.0, .unit = "Hz", .meaning = "frequency of both PWMs",
                 .range = rig::between(20, 48'000), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, enable_pin, -1, .meaning = "I/O pin that enables the motor; -1: none",
                 .range = rig::between(-1, 255), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, relay_pin, -1,
                 .meaning = "I/O pin that changes with each command, for a watchdog relay; -1: none",
                 .range = rig::between(-1, 255), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, lower_channel, 0, .meaning = "counter instance of the lower wheel",
                 .range = rig::between(0, 31), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, upper_channel, 1, .meaning = "counter instance of the upper wheel",
                 .range = rig::between(0, 31), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, lower_sign, 1, encoder_sign);
  ABS_HIL_OPTION(std::int32_t, upper_sign, 1, encoder_sign);
  ABS_HIL_OPTION(double, motor_duty_max, 1.0, motor_duty_cap);
  /// As on the RT-DAC4/PCI.
  ABS_HIL_OPTION(double, brake_duty_max, 0.7, brake_duty_cap);
  ABS_HIL_OPTION(std::int32_t, answer_timeout_us, 0, .unit = "us",
                 .meaning = "longest wait for the board's answer, at most 80 % of the period; 0: 80 % of it",
                 .range = rig::from_zero(8000), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, plausible_speed_rad_s, 1000.0, plausible_speed);
  // Known from elsewhere in the configuration.
  std::int32_t encoder_counts_per_rev{4096};
  double rate_Hz{1000.0};  ///< cycles per second
};

/// The registry's entry for driver.kind=hm2.
[[nodiscard]] Backend hm2_backend();

}  // namespace abs_hil::driver::hm2

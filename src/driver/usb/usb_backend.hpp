// The options of the RT-DAC/USB2 and its entry in the registry.

#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/board_rows.hpp"

namespace abs_hil::driver::usb {

/// Everything below `driver.usb.` in the configuration.
struct UsbOptions {
  ABS_HIL_OPTIONS(UsbOptions);
  ABS_HIL_OPTION(std::string, sysfs_root, "/sys/bus/usb/devices",
                 .meaning = "where the kernel shows what is plugged in", .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::string, device_root, "/dev/bus/usb", .meaning = "folder with the device nodes BUS/DEVICE",
                 .safety = rig::no_effect_on_safety);
  // The maker's numbers are not public.
  ABS_HIL_OPTION(std::int32_t, vendor_id, -1, .meaning = "the board's; -1: any", .range = rig::between(-1, 65535),
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::int32_t, product_id, -1, .meaning = "the board's; -1: any", .range = rig::between(-1, 65535),
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::string, manufacturer, "InTeCo",
                 .meaning = "the board's own word for its maker; empty: not compared",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::string, serial, "", .meaning = "which board; empty: the only one",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::int32_t, version, -1, .meaning = "version word that the board must show; -1: not compared",
                 .range = rig::between(-1, 65535), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, drive_pwm, 0, .meaning = "PWM channel of the drive", .range = rig::between(0, 9),
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, brake_pwm, 1, .meaning = "PWM channel of the brake", .range = rig::between(0, 9),
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, enable_line, -1, .meaning = "digital line that enables the motor; -1: none",
                 .range = rig::between(-1, 14), .safety = rig::commissioned);
  ABS_HIL_OPTION(bool, enable_inverted, false, .meaning = "the line is low while the motor is enabled",
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, lower_channel, 0, .meaning = "encoder channel of the lower wheel",
                 .range = rig::between(0, 7), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, upper_channel, 1, .meaning = "encoder channel of the upper wheel",
                 .range = rig::between(0, 7), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, lower_sign, 1, encoder_sign);
  ABS_HIL_OPTION(std::int32_t, upper_sign, 1, encoder_sign);
  ABS_HIL_OPTION(double, motor_duty_max, 1.0, motor_duty_cap);
  /// As on the RT-DAC4/PCI.
  ABS_HIL_OPTION(double, brake_duty_max, 0.7, brake_duty_cap);
  ABS_HIL_OPTION(std::string, pwm_mode, "12-bit", pwm_width);
  /// 160 Hz if the board's clock is the PCI board's.
  ABS_HIL_OPTION(std::int32_t, pwm_prescaler, 60, .meaning = "PWM frequency: clock / ((prescaler + 1) 255 or 4095)",
                 .range = rig::between(0, 65535), .safety = rig::commissioned);
  /// Whether the board shows them is not known; without it the safe state is sent and taken, but not verified.
  ABS_HIL_OPTION(bool, verify_outputs, true, .meaning = "every frame must show the PWM words that were sent",
                 .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, answer_timeout_us, 500, .unit = "us",
                 .meaning = "longest that a cycle waits for its frame; below the period",
                 .range = rig::between(50, 1'000'000), .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(double, plausible_speed_rad_s, 1000.0, plausible_speed);
  std::int32_t encoder_counts_per_rev{4096};  ///< for that check alone; 1024 lines, quadrature
};

/// The registry's entry for driver.kind=usb.
[[nodiscard]] Backend usb_backend();

}  // namespace abs_hil::driver::usb

// The options of the RT-DAC4/PCI and its entry in the registry.

#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/board_rows.hpp"

namespace abs_hil::driver::pci {

/// Everything below `driver.pci.` in the configuration.
struct PciOptions {
  ABS_HIL_OPTIONS(PciOptions);
  ABS_HIL_OPTION(std::string, root, "/sys/bus/pci/devices", .meaning = "folder with one folder for each PCI device",
                 .safety = rig::judged_elsewhere);
  ABS_HIL_OPTION(std::string, bdf, "", .meaning = "which card, as 0000:03:00.0; empty: the only one",
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::int32_t, bitstream, -1, .meaning = "version word that the card must show; -1: not compared",
                 .range = rig::between(-1, 65535), .safety = rig::commissioned);
  ABS_HIL_OPTION(double, motor_duty_max, 1.0, motor_duty_cap);
  /// The vendor's driver caps the brake's supply current at this.
  ABS_HIL_OPTION(double, brake_duty_max, 0.7, brake_duty_cap);
  /// The vendor's demos use 12-bit.
  ABS_HIL_OPTION(std::string, pwm_mode, "12-bit", pwm_width);
  /// 60 in 12-bit mode is 160 Hz, as in the vendor's demos.
  ABS_HIL_OPTION(std::int32_t, pwm_prescaler, 60, .meaning = "PWM frequency is 40 MHz / ((prescaler + 1) 255 or 4095)",
                 .range = rig::between(0, 65535), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, lower_channel, 0, .meaning = "encoder channel of the lower wheel",
                 .range = rig::between(0, 2), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, upper_channel, 1, .meaning = "encoder channel of the upper wheel",
                 .range = rig::between(0, 2), .safety = rig::commissioned);
  ABS_HIL_OPTION(std::int32_t, lower_sign, 1, encoder_sign);
  ABS_HIL_OPTION(std::int32_t, upper_sign, 1, encoder_sign);
  /// It is not known what they do and whether the host should switch them.
  ABS_HIL_OPTION(std::int32_t, start_resistors, -1,
                 .meaning = "start resistors at activation, bit 0 R1, bit 1 R2; -1: left as they are",
                 .range = rig::between(-1, 3), .safety = rig::commissioned);
  ABS_HIL_OPTION(double, plausible_speed_rad_s, 1000.0, plausible_speed);
  std::int32_t encoder_counts_per_rev{4096};  ///< for that check alone; 1024 lines, quadrature
};

/// The registry's entry for driver.kind=pci.
[[nodiscard]] Backend pci_backend();

}  // namespace abs_hil::driver::pci

#pragma once

#include <cstdint>
#include <string>

namespace abs_hil::driver::pci {

/// Everything below `driver.pci.` in the configuration.
struct PciOptions {
  std::string root{"/sys/bus/pci/devices"};  ///< folder with one folder per PCI device
  std::string bdf{};                         ///< address of the card, "0000:03:00.0"; empty: the only card
  std::int32_t bitstream{-1};                ///< required version word of the card, 0 ... 65535; -1: not compared
  double motor_duty_max{1.0};                ///< in (0, 1]
  double brake_duty_max{0.7};                ///< in (0, 1]; the vendor's driver caps the brake's supply current at this
  std::string pwm_mode{"12-bit"};            ///< "8-bit" or "12-bit"; the vendor's demos use 12-bit
  std::int32_t pwm_prescaler{60};            ///< 0 ... 65535; 60 in 12-bit mode is 160 Hz, as in the vendor's demos
  std::int32_t lower_channel{0};             ///< encoder channel of the lower wheel, 0 ... 2
  std::int32_t upper_channel{1};             ///< encoder channel of the upper wheel, 0 ... 2
  std::int32_t lower_sign{1};                ///< 1, or -1 if the channel counts down for forward motion
  std::int32_t upper_sign{1};                ///< as `lower_sign`
  /// A counter that moves faster is a fault; far above the motor's top speed. rad/s, > 0.
  double plausible_speed_rad_s{1000.0};
  std::int32_t encoder_counts_per_rev{4096};  ///< only for that check; 1024 lines, quadrature
};

}  // namespace abs_hil::driver::pci

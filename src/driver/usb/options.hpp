#pragma once

#include <cstdint>
#include <string>

namespace abs_hil::driver::usb {

/// Everything below `driver.usb.` in the configuration.
struct UsbOptions {
  std::string sysfs_root{"/sys/bus/usb/devices"};  ///< folder in which the kernel lists the devices
  std::string device_root{"/dev/bus/usb"};         ///< folder with the nodes BUS/DEVICE that libusb opens
  std::int32_t vendor_id{-1};                      ///< 0 ... 65535; -1: any. The maker's is not public
  std::int32_t product_id{-1};                     ///< 0 ... 65535; -1: any. The maker's is not public
  std::string manufacturer{"InTeCo"};              ///< manufacturer string of the device; empty: not compared
  std::string serial{};                            ///< serial number of the board; empty: the only board
  std::int32_t version{-1};                        ///< required version word of the board, 0 ... 65535; -1: any
  std::int32_t drive_pwm{0};                       ///< PWM channel of the drive, 0 ... 9
  std::int32_t brake_pwm{1};                       ///< PWM channel of the brake, 0 ... 9
  std::int32_t enable_line{-1};                    ///< digital line that enables the motor, 0 ... 14; -1: none
  bool enable_inverted{false};                     ///< the line is low while the motor is enabled
  std::int32_t lower_channel{0};                   ///< encoder channel of the lower wheel, 0 ... 7
  std::int32_t upper_channel{1};                   ///< encoder channel of the upper wheel, 0 ... 7
  std::int32_t lower_sign{1};                      ///< 1, or -1 if the channel counts down for forward motion
  std::int32_t upper_sign{1};                      ///< as `lower_sign`
  double motor_duty_max{1.0};                      ///< in (0, 1]
  double brake_duty_max{0.7};                      ///< in (0, 1]; as on the RT-DAC4/PCI
  std::string pwm_mode{"12-bit"};                  ///< "8-bit" or "12-bit"
  std::int32_t pwm_prescaler{60};                  ///< 0 ... 65535; 160 Hz if the board's clock is the PCI board's
  /// Every frame must show the PWM words that were sent. It is not known whether the board shows them. If false, the
  /// safe state is sent and accepted, but not verified.
  bool verify_outputs{true};
  std::int32_t answer_timeout_us{500};  ///< longest wait of a cycle for its frame, 50 ... 1000000; less than the period
  /// A counter that moves faster is a fault; far above the motor's top speed. rad/s, > 0.
  double plausible_speed_rad_s{1000.0};
  std::int32_t encoder_counts_per_rev{4096};  ///< only for that check; 1024 lines, quadrature
};

}  // namespace abs_hil::driver::usb

// Everything below `driver.` that describes a board: rows that several boards have, then the options of each. They are
// the same on every platform, so that each reads every configuration; drivers are not (boards_elsewhere.cpp).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/duty_grid.hpp"
#include "abs_hil/rig/option.hpp"

namespace abs_hil::driver {

/// Clock of the RT-DAC4/PCI's PWM and velocity periods.
inline constexpr double board_clock_Hz = 40e6;

/// Counter width of a PWM.
enum class PwmMode : std::uint32_t { bits_8 = 0, bits_12 = 1 };

/// The mode that the option pwm_mode names, "8-bit" or "12-bit".
[[nodiscard]] constexpr PwmMode pwm_mode_named(std::string_view name) noexcept {
  return name == "8-bit" ? PwmMode::bits_8 : PwmMode::bits_12;
}
/// Largest width, which is duty 1.
[[nodiscard]] constexpr std::uint32_t full_width(PwmMode mode) noexcept {
  return mode == PwmMode::bits_12 ? 4095 : 255;
}
/// PWM frequency, Hz: 40 MHz / ((prescaler + 1) full width).
[[nodiscard]] constexpr double pwm_frequency_Hz(PwmMode mode, std::uint32_t prescaler) noexcept {
  return board_clock_Hz / ((static_cast<double>(prescaler) + 1.0) * static_cast<double>(full_width(mode)));
}
/// The grid of a board whose options have `pwm_mode` and the two caps.
template <typename Options>
[[nodiscard]] OutputGrid pwm_grid(const Options& options) noexcept {
  return {.duty_steps = full_width(pwm_mode_named(options.pwm_mode)),
          .motor_duty_max = options.motor_duty_max,
          .brake_duty_max = options.brake_duty_max};
}

// Options that every board has.

inline constexpr rig::OptionFacts motor_duty_cap{
    .meaning = "largest drive PWM the driver sends", .range = rig::positive(1), .safety = rig::commissioned};
inline constexpr rig::OptionFacts brake_duty_cap{
    .meaning = "largest brake PWM the driver sends; caps gate.brake_duty_max",
    .range = rig::positive(1),
    .safety = rig::commissioned};
/// Far above what the motor reaches.
inline constexpr rig::OptionFacts plausible_speed{.unit = "rad/s",
                                                  .meaning = "a counter that goes faster is a fault",
                                                  .range = rig::between(10, 100'000),
                                                  .safety = rig::weaker_above(1000)};
inline constexpr rig::OptionFacts pwm_width{
    .meaning = "counting width of the PWMs", .allowed = {"8-bit", "12-bit"}, .safety = rig::commissioned};
inline constexpr rig::OptionFacts encoder_sign{.meaning = "1, or -1 if the channel counts down going forward",
                                               .range = rig::between(-1, 1),
                                               .safety = rig::commissioned};

/// Everything below `driver.sim.` in the configuration: the board of the simulated rig.
struct SimOptions {
  ABS_HIL_OPTIONS(SimOptions);
  /// As the RT-DAC4/PCI in the vendor's demos.
  ABS_HIL_OPTION(std::string, pwm_mode, "12-bit", .meaning = pwm_width.meaning, .allowed = pwm_width.allowed,
                 .safety = rig::no_effect_on_safety);
};

}  // namespace abs_hil::driver

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

#include "config/usb_keys.hpp"

#include "config/board_ranges.hpp"

namespace abs_hil::config {

namespace {

constexpr Range any_or_id{-1, 65535};
constexpr Range pwm_channel{0, 9};
constexpr Range usb_encoder_channel{0, 7};
constexpr Range line_or_none{-1, 14};

}  // namespace

void add_usb_keys(std::vector<Key>& keys, driver::usb::UsbOptions& u) {
  keys.insert(
      keys.end(),
      {
          {"driver.usb.sysfs_root", "", "where the kernel shows what is plugged in", &u.sysfs_root},
          {"driver.usb.device_root", "", "folder with the device nodes BUS/DEVICE", &u.device_root},
          {"driver.usb.vendor_id", "", "the board's; -1: any", &u.vendor_id, any_or_id},
          {"driver.usb.product_id", "", "the board's; -1: any", &u.product_id, any_or_id},
          {"driver.usb.manufacturer", "", "the board's own word for its maker; empty: not compared", &u.manufacturer},
          {"driver.usb.serial", "", "which board; empty: the only one", &u.serial},
          {"driver.usb.version", "", "version word that the board must show; -1: not compared", &u.version, any_or_id},
          {"driver.usb.drive_pwm", "", "PWM channel of the drive", &u.drive_pwm, pwm_channel},
          {"driver.usb.brake_pwm", "", "PWM channel of the brake", &u.brake_pwm, pwm_channel},
          {"driver.usb.enable_line", "", "digital line that enables the motor; -1: none", &u.enable_line, line_or_none},
          {"driver.usb.enable_inverted", "", "the line is low while the motor is enabled", &u.enable_inverted},
          {"driver.usb.lower_channel", "", "encoder channel of the lower wheel", &u.lower_channel, usb_encoder_channel},
          {"driver.usb.upper_channel", "", "encoder channel of the upper wheel", &u.upper_channel, usb_encoder_channel},
          {"driver.usb.lower_sign", "", "1, or -1 if the channel counts down going forward", &u.lower_sign,
           counting_direction},
          {"driver.usb.upper_sign", "", "1, or -1 if the channel counts down going forward", &u.upper_sign,
           counting_direction},
          {"driver.usb.motor_duty_max", "", "largest drive PWM the driver sends", &u.motor_duty_max, board_duty_cap},
          {"driver.usb.brake_duty_max", "", "largest brake PWM the driver sends; caps gate.brake_duty_max",
           &u.brake_duty_max, board_duty_cap},
          {"driver.usb.pwm_mode", "", "counting width of the PWMs", &u.pwm_mode, {}, {"8-bit", "12-bit"}},
          {"driver.usb.pwm_prescaler", "", "PWM frequency: clock / ((prescaler + 1) 255 or 4095)", &u.pwm_prescaler,
           Range{0, 65535}},
          {"driver.usb.verify_outputs", "", "every frame must show the PWM words that were sent", &u.verify_outputs},
          {"driver.usb.answer_timeout_us", "us", "longest that a cycle waits for its frame; below the period",
           &u.answer_timeout_us, Range{50, 1'000'000}},
          {"driver.usb.plausible_speed_rad_s", "rad/s", "a counter that goes faster is a fault",
           &u.plausible_speed_rad_s, Range{10, 100'000}},
      });
}

}  // namespace abs_hil::config

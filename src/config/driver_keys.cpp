#include "config/driver_keys.hpp"

#include "config/board_ranges.hpp"
#include "config/can_keys.hpp"
#include "config/usb_keys.hpp"

namespace abs_hil::config {

namespace {

constexpr Range pci_encoder_channel{0.0, 2.0};

void add_pci_keys(std::vector<Key>& keys, driver::pci::PciOptions& p) {
  keys.insert(
      keys.end(),
      {
          {"driver.pci.root", "", "folder with one folder for each PCI device", &p.root},
          {"driver.pci.bdf", "", "which card, as 0000:03:00.0; empty: the only one", &p.bdf},
          {"driver.pci.bitstream",
           "",
           "version word that the card must show; -1: not compared",
           &p.bitstream,
           {-1, 65535}},
          {"driver.pci.motor_duty_max", "", "largest drive PWM the driver sends", &p.motor_duty_max, board_duty_cap},
          {"driver.pci.brake_duty_max", "", "largest brake PWM the driver sends; caps gate.brake_duty_max",
           &p.brake_duty_max, board_duty_cap},
          {"driver.pci.pwm_mode", "", "counting width of the PWMs", &p.pwm_mode, {}, {"8-bit", "12-bit"}},
          {"driver.pci.pwm_prescaler",
           "",
           "PWM frequency is 40 MHz / ((prescaler + 1) 255 or 4095)",
           &p.pwm_prescaler,
           {0, 65535}},
          {"driver.pci.lower_channel", "", "encoder channel of the lower wheel", &p.lower_channel, pci_encoder_channel},
          {"driver.pci.upper_channel", "", "encoder channel of the upper wheel", &p.upper_channel, pci_encoder_channel},
          {"driver.pci.lower_sign", "", "1, or -1 if the channel counts down going forward", &p.lower_sign,
           counting_direction},
          {"driver.pci.upper_sign", "", "1, or -1 if the channel counts down going forward", &p.upper_sign,
           counting_direction},
          {"driver.pci.plausible_speed_rad_s",
           "rad/s",
           "a counter that goes faster is a fault",
           &p.plausible_speed_rad_s,
           {10, 100'000}},
      });
}

}  // namespace

void add_driver_keys(std::vector<Key>& keys, driver::DriverOptions& d) {
  std::vector<std::string_view> kinds;
  for (const driver::BackendEntry& board : driver::boards()) kinds.push_back(board.name);
  keys.insert(
      keys.end(),
      {
          {"driver.kind", "", "board behind --backend rig", &d.kind, {}, {kinds.begin(), kinds.end()}},
          {"driver.emulated", "", "the board is an emulator: --fast may drive its time in lock-step", &d.emulated},
          {"driver.verified_on_hardware", "", "this lab has gone through docs/rig-setup.md on its own rig",
           &d.verified_on_hardware},
      });
  add_pci_keys(keys, d.pci);
  add_can_keys(keys, d.can);
  add_usb_keys(keys, d.usb);
}

}  // namespace abs_hil::config

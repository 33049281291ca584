#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "driver/usb/options.hpp"

namespace abs_hil::driver::usb {

/// A device as the kernel shows it below /sys/bus/usb/devices, readable by everybody.
struct UsbDevice {
  std::string address{};  ///< "1-1.4": bus and ports
  std::uint32_t vendor_id{0};
  std::uint32_t product_id{0};
  std::string manufacturer{};
  std::string product{};
  std::string serial{};
  std::filesystem::path node{};  ///< what libusb opens
  /// "04b4:1003 serial 123 at 1-1.4", for messages.
  [[nodiscard]] std::string text() const;
};

/// The devices that ids, manufacturer and serial of the options fit, by address; none where there is no USB. With
/// neither ids nor manufacturer configured nothing fits: any device would.
[[nodiscard]] std::vector<UsbDevice> find_boards(const UsbOptions& options);

/// The one board that the options mean. Throws Unavailable: none, or several, with what mends it.
/// @param lock_step the emulator's clock is to be driven: refused where there is none, as on all hardware; without it
///                  an emulator that waits for lock-step is refused
/// @param emulated  the configuration says that the board is an emulator: anything else is refused
[[nodiscard]] UsbDevice choose_board(const UsbOptions& options, bool lock_step, bool emulated);

/// What the product string of an emulator holds, and of one in lock-step ends with; no hardware's does.
inline constexpr const char* emulator_mark = "emulator";
inline constexpr const char* lock_step_mark = "emulator in lock-step";

/// The line for /etc/udev/rules.d that gives the group abs_hil the device.
[[nodiscard]] std::string udev_rule(const UsbDevice& device);

}  // namespace abs_hil::driver::usb

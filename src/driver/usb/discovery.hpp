// Finds the RT-DAC/USB2 in sysfs, and the interface of it that has the endpoints.

#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "driver/board_options.hpp"

namespace abs_hil::driver::usb {

/// A device as the kernel shows it below /sys/bus/usb/devices, readable by every user.
struct UsbDevice {
  std::string address{};  ///< "1-1.4": bus and ports
  std::uint32_t vendor_id{0};
  std::uint32_t product_id{0};
  std::string manufacturer{};
  std::string product{};
  std::string serial{};
  std::uint32_t configuration{0};  ///< the active one; 0: none
  std::filesystem::path node{};    ///< the device's file, for usbfs
  /// "04b4:1003 serial 123 at 1-1.4", for messages.
  [[nodiscard]] std::string text() const;
};

/// The devices that match the ids, manufacturer and serial of the options, sorted by address; empty without USB.
/// Without ids and manufacturer in the options no device matches, because otherwise every device would.
[[nodiscard]] std::vector<UsbDevice> find_boards(const UsbOptions& options);

/// The board that the options select. Throws Unavailable with a fix if there is none, or more than one.
/// @param lock_step advance the emulator's clock; refused without such a clock, as on all hardware. If false, an
/// emulator
///                  in lock-step is refused
/// @param emulated  the board must be an emulator; any other board is refused
[[nodiscard]] UsbDevice choose_board(const UsbOptions& options, bool lock_step, bool emulated);

/// An emulator's product string contains `emulator_mark`; in lock-step it ends with `lock_step_mark`. No hardware has
/// these.
inline constexpr const char* emulator_mark = "emulator";
inline constexpr const char* lock_step_mark = "emulator in lock-step";

/// Line for /etc/udev/rules.d that gives the group abs_hil access to the device.
[[nodiscard]] std::string udev_rule(const UsbDevice& device);

/// An interface, and the alternate setting of it.
struct InterfaceSetting {
  std::uint8_t interface {
    0
  };
  std::uint8_t alternate{0};
};

/// Finds the first interface and alternate setting with both bulk endpoints of the FPGA.
/// @param descriptors   what a device node reads: the device's descriptor, then those of its configurations. Any bytes
///                      are allowed; what is cut short counts as missing
/// @param configuration the active one (bConfigurationValue)
[[nodiscard]] std::optional<InterfaceSetting> find_interface(std::span<const std::uint8_t> descriptors,
                                                             std::uint32_t configuration) noexcept;

}  // namespace abs_hil::driver::usb

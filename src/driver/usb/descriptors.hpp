#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace abs_hil::driver::usb {

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

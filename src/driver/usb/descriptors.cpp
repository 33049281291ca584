#include "driver/usb/descriptors.hpp"

#include <linux/usb/ch9.h>

#include <cstddef>

#include "driver/usb/frame_link.hpp"

namespace abs_hil::driver::usb {

namespace {

// Bytes of the descriptors (USB 2.0, section 9.6). The first two of each are its length and its type.
constexpr std::size_t configuration_value = 5;
constexpr std::size_t interface_number = 2;
constexpr std::size_t interface_alternate = 3;
constexpr std::size_t endpoint_address = 2;
constexpr std::size_t endpoint_attributes = 3;

constexpr unsigned out_found = 1;
constexpr unsigned in_found = 2;

/// Which of the FPGA's endpoints this is; 0: neither.
unsigned which(std::span<const std::uint8_t> endpoint) noexcept {
  if ((endpoint[endpoint_attributes] & USB_ENDPOINT_XFERTYPE_MASK) != USB_ENDPOINT_XFER_BULK) return 0;
  if (endpoint[endpoint_address] == endpoint_out) return out_found;
  return endpoint[endpoint_address] == endpoint_in ? in_found : 0;
}

}  // namespace

std::optional<InterfaceSetting> find_interface(std::span<const std::uint8_t> descriptors,
                                               std::uint32_t configuration) noexcept {
  bool active = false;
  std::optional<InterfaceSetting> setting;  // of the active configuration; the one whose endpoints follow
  unsigned found = 0;
  while (descriptors.size() >= 2) {
    const std::size_t length = descriptors[0];
    if (length < 2 || length > descriptors.size()) return {};
    const auto one = descriptors.first(length);
    descriptors = descriptors.subspan(length);
    const std::uint8_t type = one[1];
    if (type == USB_DT_CONFIG && length >= USB_DT_CONFIG_SIZE) {
      active = one[configuration_value] == configuration;
      setting.reset();
    } else if (type == USB_DT_INTERFACE && length >= USB_DT_INTERFACE_SIZE && active) {
      setting = {.interface = one[interface_number], .alternate = one[interface_alternate]};
      found = 0;
    } else if (type == USB_DT_ENDPOINT && length >= USB_DT_ENDPOINT_SIZE && setting) {
      found |= which(one);
      if (found == (out_found | in_found)) return setting;
    }
  }
  return {};
}

}  // namespace abs_hil::driver::usb

// Finds the board in sysfs by its ids and names.
#include <linux/usb/ch9.h>

#include <algorithm>
#include <cstddef>
#include <system_error>

#include "driver/board_kit.hpp"
#include "driver/sysfs.hpp"
#include "driver/usb/wire.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::usb {

namespace {

namespace fs = std::filesystem;

bool fits(std::int32_t wanted, std::uint32_t is) { return wanted < 0 || static_cast<std::uint32_t>(wanted) == is; }

bool fits(const UsbOptions& o, const UsbDevice& d) {
  const bool anything_asked = o.vendor_id >= 0 || o.product_id >= 0 || !o.manufacturer.empty();
  return anything_asked && fits(o.vendor_id, d.vendor_id) && fits(o.product_id, d.product_id) &&
         (o.manufacturer.empty() || o.manufacturer == d.manufacturer) && (o.serial.empty() || o.serial == d.serial);
}

UsbDevice device_in(const fs::path& folder, const fs::path& device_root) {
  const std::string node =
      rig::formatted("%03u/%03u", number_in(folder / "busnum", 10), number_in(folder / "devnum", 10));
  constexpr int hexadecimal = 16;
  return {.address = folder.filename().string(),
          .vendor_id = number_in(folder / "idVendor", hexadecimal),
          .product_id = number_in(folder / "idProduct", hexadecimal),
          .manufacturer = line_in(folder / "manufacturer"),
          .product = line_in(folder / "product"),
          .serial = line_in(folder / "serial"),
          .configuration = number_in(folder / "bConfigurationValue", 10),
          .node = device_root / node};
}

std::string wanted_text(const UsbOptions& o) {
  const auto id = [](std::int32_t value) {
    return value < 0 ? std::string("any") : rig::formatted("%04x", static_cast<std::uint32_t>(value));
  };
  return "driver.usb.manufacturer=\"" + o.manufacturer + "\", ids " + id(o.vendor_id) + ":" + id(o.product_id) +
         (o.serial.empty() ? "" : ", serial " + o.serial);
}

}  // namespace

std::string UsbDevice::text() const {
  return rig::formatted("%04x:%04x", vendor_id, product_id) + (serial.empty() ? "" : " serial " + serial) + " at " +
         address;
}

std::vector<UsbDevice> find_boards(const UsbOptions& options) {
  std::vector<UsbDevice> boards;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(options.sysfs_root, none)) {
    if (!fs::exists(entry.path() / "idVendor", none)) continue;  // an interface, not a device
    UsbDevice device = device_in(entry.path(), options.device_root);
    if (fits(options, device)) boards.push_back(std::move(device));
  }
  std::sort(boards.begin(), boards.end(), [](const auto& a, const auto& b) { return a.address < b.address; });
  return boards;
}

UsbDevice choose_board(const UsbOptions& options, bool lock_step, bool emulated) {
  const std::vector<UsbDevice> boards = find_boards(options);
  if (boards.empty()) {
    refuse("no RT-DAC/USB2 board (driver.kind=usb, " + wanted_text(options) + ") in " + options.sysfs_root +
           "; check with lsusb (docs/usb.md). To run without the rig, use --backend sim");
  }
  if (boards.size() > 1) {
    std::vector<std::string> all;
    for (const UsbDevice& board : boards) all.push_back(board.text());
    refuse(std::to_string(boards.size()) + " boards: " + rig::joined(all) +
           "; choose one with --set driver.usb.serial=" + boards.front().serial);
  }
  const UsbDevice& board = boards.front();
  if (emulated && board.product.find(emulator_mark) == std::string::npos) {
    refuse("USB board " + board.text() + " (\"" + board.product +
           "\") is not an emulator, but driver.emulated=true says so: remove that key");
  }
  const bool waits_for_lock_step = board.product.ends_with(lock_step_mark);
  require_lock_step("USB board " + board.text(), lock_step, waits_for_lock_step, "--usb --lock-step");
  return board;
}

std::string udev_rule(const UsbDevice& device) {
  return rig::formatted(
      R"(SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device", ATTR{idVendor}=="%04x", ATTR{idProduct}=="%04x", )"
      R"(GROUP="abs_hil", MODE="0660")",
      device.vendor_id, device.product_id);
}

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
      setting = {.number = one[interface_number], .alternate = one[interface_alternate]};
      found = 0;
    } else if (type == USB_DT_ENDPOINT && length >= USB_DT_ENDPOINT_SIZE && setting) {
      found |= which(one);
      if (found == (out_found | in_found)) return setting;
    }
  }
  return {};
}

}  // namespace abs_hil::driver::usb

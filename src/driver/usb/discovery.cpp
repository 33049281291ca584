#include "driver/usb/discovery.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <system_error>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"

namespace abs_hil::driver::usb {

namespace {

namespace fs = std::filesystem;

std::string line_in(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

std::uint32_t number_in(const fs::path& file, int base) {
  return static_cast<std::uint32_t>(std::strtoul(line_in(file).c_str(), nullptr, base));
}

std::string hex(std::uint32_t value) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%04x", value);
  return text.data();
}

bool fits(std::int32_t wanted, std::uint32_t is) { return wanted < 0 || static_cast<std::uint32_t>(wanted) == is; }

bool fits(const UsbOptions& o, const UsbDevice& d) {
  const bool anything_asked = o.vendor_id >= 0 || o.product_id >= 0 || !o.manufacturer.empty();
  return anything_asked && fits(o.vendor_id, d.vendor_id) && fits(o.product_id, d.product_id) &&
         (o.manufacturer.empty() || o.manufacturer == d.manufacturer) && (o.serial.empty() || o.serial == d.serial);
}

UsbDevice device_in(const fs::path& folder, const fs::path& device_root) {
  std::array<char, 16> node{};
  std::snprintf(node.data(), node.size(), "%03u/%03u", number_in(folder / "busnum", 10) % 1000,
                number_in(folder / "devnum", 10) % 1000);
  constexpr int hexadecimal = 16;
  return {.address = folder.filename().string(),
          .vendor_id = number_in(folder / "idVendor", hexadecimal),
          .product_id = number_in(folder / "idProduct", hexadecimal),
          .manufacturer = line_in(folder / "manufacturer"),
          .product = line_in(folder / "product"),
          .serial = line_in(folder / "serial"),
          .configuration = number_in(folder / "bConfigurationValue", 10),
          .node = device_root / node.data()};
}

std::string wanted_text(const UsbOptions& o) {
  const auto id = [](std::int32_t value) {
    return value < 0 ? std::string("any") : hex(static_cast<std::uint32_t>(value));
  };
  return "driver.usb.manufacturer=\"" + o.manufacturer + "\", ids " + id(o.vendor_id) + ":" + id(o.product_id) +
         (o.serial.empty() ? "" : ", serial " + o.serial);
}

}  // namespace

std::string UsbDevice::text() const {
  return hex(vendor_id) + ":" + hex(product_id) + (serial.empty() ? "" : " serial " + serial) + " at " + address;
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
    std::string all;
    for (const UsbDevice& board : boards) all += (all.empty() ? "" : ", ") + board.text();
    refuse(std::to_string(boards.size()) + " boards: " + all +
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
  return R"(SUBSYSTEM=="usb", ENV{DEVTYPE}=="usb_device", ATTR{idVendor}==")" + hex(device.vendor_id) +
         R"(", ATTR{idProduct}==")" + hex(device.product_id) + R"(", GROUP="abs_hil", MODE="0660")";
}

}  // namespace abs_hil::driver::usb

#include "diagnosis/board_scan.hpp"

#include <fcntl.h>
#include <unistd.h>

#include "abs_hil/driver/io_result.hpp"
#include "diagnosis/text_file.hpp"
#include "driver/pci/discovery.hpp"

namespace abs_hil::diagnosis {

namespace {

namespace fs = std::filesystem;

/// Addresses of the cards below a folder; empty if it does not exist.
std::vector<std::string> addresses(const fs::path& devices) try {
  return driver::pci::find_cards(devices);
} catch (const driver::Unavailable&) {
  return {};
}

/// Opening a resource file does not access a register.
bool can_read_and_write(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor >= 0) ::close(descriptor);
  return descriptor >= 0;
}

Finding judge_board(const PciBoard& board) {
  Finding f{.check = "boards", .what = "RT-DAC4/PCI at " + board.address};
  const std::string folder = board.folder.string();
  const auto add = [&f](const std::string& detail, const std::string& fix) {
    f.standing = Standing::warning;
    f.detail += (f.detail.empty() ? "" : "; ") + detail;
    f.fix += (f.fix.empty() ? "" : "\n") + fix;
  };
  if (!board.bound_driver.empty()) {
    add("owned by the kernel driver " + board.bound_driver,
        "echo " + board.address + " | sudo tee " + folder + "/driver/unbind");
  }
  if (!board.enabled) add("not enabled", "echo 1 | sudo tee " + folder + "/enable");
  if (!board.accessible) {
    add("registers not accessible to this user", "sudo chgrp abs_hil " + folder + "/resource2 && sudo chmod g+rw " +
                                                     folder +
                                                     "/resource2; for good: the udev rule of docs/rig-setup.md");
  }
  if (f.detail.empty()) f.detail = "no kernel driver, enabled, registers accessible";
  return f;
}

}  // namespace

std::vector<PciBoard> find_pci_boards(const fs::path& devices) {
  std::vector<PciBoard> boards;
  for (const std::string& address : addresses(devices)) {
    const fs::path device = devices / address;
    std::error_code none_bound;
    const fs::path driver = fs::read_symlink(device / "driver", none_bound);
    boards.push_back({.address = address,
                      .folder = device,
                      .bound_driver = none_bound ? "" : driver.filename().string(),
                      .enabled = first_line(device / "enable", "0") != "0",
                      .accessible = can_read_and_write(device / "resource2")});
  }
  return boards;
}

std::vector<Finding> judge(const std::vector<PciBoard>& boards) {
  if (boards.empty()) {
    return {{.check = "boards", .what = "no RT-DAC4/PCI (10b5:2497) found", .standing = Standing::note}};
  }
  std::vector<Finding> findings;
  findings.reserve(boards.size());
  for (const PciBoard& board : boards) findings.push_back(judge_board(board));
  return findings;
}

std::vector<Finding> judge(const std::vector<driver::usb::UsbDevice>& boards) {
  if (boards.empty()) {
    return {{.check = "boards",
             .what = "no RT-DAC/USB2 found",
             .standing = Standing::note,
             .detail = "searched by driver.usb.manufacturer, .vendor_id, .product_id and .serial"}};
  }
  std::vector<Finding> findings;
  for (const driver::usb::UsbDevice& board : boards) {
    Finding f{
        .check = "boards",
        .what = "RT-DAC/USB2 " + board.text(),
        .detail = "\"" + board.manufacturer + "\", \"" + board.product + "\"; this driver is unverified on hardware"};
    if (!can_read_and_write(board.node)) {
      f.standing = Standing::warning;
      f.detail += "; " + board.node.string() + " not accessible to this user";
      f.fix = "put this line into /etc/udev/rules.d/70-abs-hil.rules and plug the board in again (docs/usb.md):\n" +
              driver::usb::udev_rule(board);
    }
    findings.push_back(std::move(f));
  }
  return findings;
}

}  // namespace abs_hil::diagnosis

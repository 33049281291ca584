#include "driver/pci/card_survey.hpp"

#include <filesystem>
#include <string>

#include "driver/file_descriptor.hpp"
#include "driver/pci/card_obstacles.hpp"
#include "driver/pci/discovery.hpp"

namespace abs_hil::driver::pci {

namespace {

namespace fs = std::filesystem;

/// Addresses of the cards below a folder; empty if it does not exist.
std::vector<std::string> addresses(const fs::path& devices) try {
  return find_cards(devices);
} catch (const Unavailable&) {
  return {};
}

std::vector<FoundBoard::Obstacle> obstacles_or_error(const fs::path& device) try {
  check_bar2(device);
  return card_obstacles(device);
} catch (const Unavailable& error) {
  return {{error.what(), "compare with lspci -vv (docs/rig-setup.md)"}};
}

FoundBoard surveyed(const fs::path& device) {
  const std::string address = device.filename().string();
  const std::string folder = device.string();
  FoundBoard board{.what = "RT-DAC4/PCI at " + address,
                   .selection = {"driver.pci.bdf=" + address},
                   .files = {folder + "/resource2"},
                   .obstacles = obstacles_or_error(device)};
  if (!can_be_opened(device / "resource2")) {
    board.obstacles.push_back({"registers not accessible to this user",
                               "sudo chgrp abs_hil " + folder + "/resource2 && sudo chmod g+rw " + folder +
                                   "/resource2; for good: the udev rule of docs/rig-setup.md"});
  }
  if (board.obstacles.empty()) board.detail = "no kernel driver, enabled, registers accessible";
  return board;
}

}  // namespace

std::vector<FoundBoard> survey_cards(const PciOptions& options) {
  std::vector<FoundBoard> boards;
  for (const std::string& address : addresses(options.root)) {
    if (options.bdf.empty() || options.bdf == address) boards.push_back(surveyed(fs::path(options.root) / address));
  }
  return boards;
}

}  // namespace abs_hil::driver::pci

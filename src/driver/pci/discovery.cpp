#include "driver/pci/discovery.hpp"

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <optional>
#include <system_error>

#include "driver/board_kit.hpp"
#include "driver/pci/card_obstacles.hpp"
#include "driver/pci/register_map.hpp"
#include "driver/pci/sysfs_window.hpp"

namespace abs_hil::driver::pci {

namespace {

namespace fs = std::filesystem;

constexpr int bar_number = 2;
// include/linux/ioport.h
constexpr std::uint64_t ioresource_io = 0x100;
constexpr std::uint64_t ioresource_disabled = 0x10000000;
constexpr std::uint64_t ioresource_unset = 0x20000000;

std::string hex(std::uint64_t value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "0x%04" PRIx64, value);
  return text.data();
}

/// The number that a sysfs file holds ("0x10b5"); nothing if it cannot be read.
std::optional<std::uint64_t> number_in(const fs::path& file) {
  std::ifstream in(file);
  std::string text;
  std::uint64_t value = 0;
  if (!(in >> text) || std::sscanf(text.c_str(), "%" SCNx64, &value) != 1) return std::nullopt;
  return value;
}

bool is_the_card(const fs::path& folder) {
  return number_in(folder / "vendor") == vendor_id && number_in(folder / "device") == device_id;
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

constexpr const char* how_to_look = "check with lspci -nn -d 10b5:2497 (docs/rig-setup.md)";

std::string choose(const PciOptions& options) {
  const fs::path root(options.root);
  if (!options.bdf.empty()) {
    const fs::path folder = root / options.bdf;
    std::error_code ignored;
    if (!fs::is_directory(folder, ignored)) {
      refuse("no PCI device " + options.bdf + " in " + options.root + " (driver.pci.bdf); " + how_to_look);
    }
    if (!is_the_card(folder)) {
      refuse("PCI device " + options.bdf + " (driver.pci.bdf) is " + hex(number_in(folder / "vendor").value_or(0)) +
             ":" + hex(number_in(folder / "device").value_or(0)) + ", not the RT-DAC4/PCI " + hex(vendor_id) + ":" +
             hex(device_id));
    }
    return options.bdf;
  }
  const std::vector<std::string> cards = find_cards(root);
  if (cards.empty()) {
    refuse("no RT-DAC4/PCI card (driver.kind=pci, " + hex(vendor_id) + ":" + hex(device_id) + ") in " + options.root +
           "; " + how_to_look + ". To run without the rig, use --backend sim");
  }
  if (cards.size() > 1) {
    refuse(std::to_string(cards.size()) + " cards in " + options.root + ": " + joined(cards) +
           "; choose one with --set driver.pci.bdf=" + cards.front());
  }
  return cards.front();
}

void refuse_obstacles(const fs::path& folder, const std::vector<FoundBoard::Obstacle>& obstacles) {
  if (obstacles.empty()) return;
  const FoundBoard::Obstacle& first = obstacles.front();
  refuse("card " + folder.string() + ": " + first.what + "; nothing was written. " + first.fix);
}

}  // namespace

void check_bar2(const fs::path& folder) {
  const BarInfo bar = read_bar2(folder);
  const std::string place = (folder / "resource").string() + ": BAR 2 ";
  if (bar.bytes == 0) {
    refuse(place + "is missing; the card must have one of " + std::to_string(window_bytes) + " bytes");
  }
  if (!bar.io_ports) {
    refuse(place +
           "is memory, not I/O ports: this is another card, or it has another board logic; nothing was written");
  }
  if (bar.bytes < window_bytes) {
    refuse(place + "has " + std::to_string(bar.bytes) + " bytes; the register map needs " +
           std::to_string(window_bytes) + ": this is another card, or it has another board logic; nothing was written");
  }
  // sysfs gives the file the size of the BAR, or the size 0, which tells nothing. Otherwise both sizes must agree.
  std::error_code error;
  const std::uintmax_t file_bytes = fs::file_size(folder / "resource2", error);
  if (!error && file_bytes != 0 && file_bytes < window_bytes) {
    refuse((folder / "resource2").string() + " has " + std::to_string(file_bytes) + " bytes; the register map needs " +
           std::to_string(window_bytes) + "; nothing was written");
  }
}

std::vector<std::string> find_cards(const fs::path& root) {
  std::error_code error;
  std::vector<std::string> cards;
  fs::directory_iterator entries(root, error);
  if (error) {
    refuse("cannot look for PCI devices in " + root.string() + " (driver.pci.root): " + error.message() +
           ". To run without the rig, use --backend sim");
  }
  for (const fs::directory_iterator end; entries != end && !error; entries.increment(error)) {
    if (is_the_card(entries->path())) cards.push_back(entries->path().filename().string());
  }
  std::sort(cards.begin(), cards.end());
  return cards;
}

BarInfo read_bar2(const fs::path& device_folder) {
  // A line for each region: "0x000000000000e000 0x000000000000e0ff 0x0000000000040101", start, end and flags.
  const fs::path file = device_folder / "resource";
  std::ifstream in(file);
  std::string line;
  for (int number = 0; number <= bar_number; ++number) {
    if (!std::getline(in, line)) refuse(file.string() + ": cannot be read as far as BAR 2");
  }
  std::uint64_t start = 0;
  std::uint64_t end = 0;
  std::uint64_t flags = 0;
  if (std::sscanf(line.c_str(), "%" SCNx64 " %" SCNx64 " %" SCNx64, &start, &end, &flags) != 3) {
    refuse(file.string() + ": \"" + line + "\" is not a region: start, end and flags in hexadecimal");
  }
  const bool absent = start == 0 && end == 0;
  return {.bytes = absent || end < start ? 0 : end - start + 1,
          .io_ports = (flags & ioresource_io) != 0,
          .unset = start == 0 || (flags & ioresource_unset) != 0,
          .disabled = (flags & ioresource_disabled) != 0};
}

Card open_card(const PciOptions& options, bool lock_step) {
  const std::string bdf = choose(options);
  const fs::path folder = fs::path(options.root) / bdf;
  check_bar2(folder);
  refuse_obstacles(folder, card_obstacles(folder));
  std::error_code ignored;
  const bool waits_for_lock_step = fs::exists(folder / emulated_time_file, ignored);
  require_lock_step("the card in " + folder.string(), lock_step, waits_for_lock_step);
  Card card{.window = std::make_unique<SysfsWindow>(folder / "resource2"),
            .place = bdf + " in " + options.root,
            .address = bdf};
  if (lock_step) card.time = std::make_unique<EmulatedTimeFile>(folder / emulated_time_file);
  return card;
}

std::unique_ptr<RegisterWindow> open_beside_owner(const PciOptions& options, bool beside_guardian, std::string* file) {
  const fs::path folder = fs::path(options.root) / choose(options);
  if (file != nullptr) *file = (folder / "resource2").string();
  check_bar2(folder);
  refuse_obstacles(folder, port_obstacles(folder));
  return std::make_unique<SysfsWindow>(folder / "resource2",
                                       beside_guardian ? WindowUse::beside_guardian : WindowUse::guardian);
}

}  // namespace abs_hil::driver::pci

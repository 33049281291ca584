// Finds the card in sysfs and checks that a run can use it.
#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <system_error>

#include "driver/pci/wire.hpp"
#include "driver/sysfs.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::driver::pci {

namespace {

namespace fs = std::filesystem;
using Obstacles = std::vector<FoundBoard::Obstacle>;

constexpr int bar_number = 2;
// include/linux/ioport.h
constexpr std::uint64_t ioresource_io = 0x100;
constexpr std::uint64_t ioresource_disabled = 0x10000000;
constexpr std::uint64_t ioresource_unset = 0x20000000;

constexpr const char* how_to_look = "check with lspci -nn -d 10b5:2497 (docs/rig-setup.md)";

std::string ids_in(const fs::path& folder) {
  return rig::formatted("0x%04x:0x%04x", number_in(folder / "vendor", 16), number_in(folder / "device", 16));
}

std::string ids_of_the_card() { return rig::formatted("0x%04x:0x%04x", vendor_id, device_id); }

bool is_the_card(const fs::path& folder) { return ids_in(folder) == ids_of_the_card(); }

std::string choose(const PciOptions& options) {
  const fs::path root(options.root);
  if (!options.bdf.empty()) {
    const fs::path folder = root / options.bdf;
    std::error_code ignored;
    if (!fs::is_directory(folder, ignored)) {
      refuse("no PCI device " + options.bdf + " in " + options.root + " (driver.pci.bdf); " + how_to_look);
    }
    if (!is_the_card(folder)) {
      refuse("PCI device " + options.bdf + " (driver.pci.bdf) is " + ids_in(folder) + ", not the RT-DAC4/PCI " +
             ids_of_the_card());
    }
    return options.bdf;
  }
  const std::vector<std::string> cards = find_cards(root);
  if (cards.empty()) {
    refuse("no RT-DAC4/PCI card (driver.kind=pci, " + ids_of_the_card() + ") in " + options.root + "; " + how_to_look +
           ". To run without the rig, use --backend sim");
  }
  if (cards.size() > 1) {
    refuse(std::to_string(cards.size()) + " cards in " + options.root + ": " + rig::joined(cards) +
           "; choose one with --set driver.pci.bdf=" + cards.front());
  }
  return cards.front();
}

/// BAR 2 as sysfs' `resource` describes it.
struct BarInfo {
  std::uint64_t bytes{0};
  bool io_ports{false};
  bool unset{false};     ///< neither firmware nor kernel has given it an address
  bool disabled{false};  ///< the kernel has switched it off
};
/// Throws Unavailable if the file cannot be read as a table of regions.
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

/// Throws Unavailable unless BAR 2 has the kind and size of the card's.
void check_bar2(const fs::path& folder) {
  const BarInfo bar = read_bar2(folder);
  const std::string place = (folder / "resource").string() + ": BAR 2 ";
  const std::string needed = std::to_string(window_bytes);
  constexpr const char* other_card = "this is another card, or it has another board logic; nothing was written";
  if (bar.bytes == 0) refuse(place + "is missing; the card must have one of " + needed + " bytes");
  if (!bar.io_ports) refuse(place + "is memory, not I/O ports: " + other_card);
  if (bar.bytes < window_bytes) {
    refuse(place + "has " + std::to_string(bar.bytes) + " bytes; the register map needs " + needed + ": " + other_card);
  }
  // sysfs gives the file the size of the BAR, or the size 0, which tells nothing. Otherwise both sizes must agree.
  std::error_code error;
  const std::uintmax_t file_bytes = fs::file_size(folder / "resource2", error);
  if (!error && file_bytes != 0 && file_bytes < window_bytes) {
    refuse((folder / "resource2").string() + " has " + std::to_string(file_bytes) + " bytes; the register map needs " +
           needed + "; nothing was written");
  }
}

/// True if the kernel of this tree of files is locked down and refuses to write to I/O ports.
bool is_locked_down(const fs::path& devices) {
  // ROOT/sys/bus/pci/devices -> ROOT/sys/kernel/security/lockdown, "none [integrity] confidentiality"
  const std::string line = line_in((devices / "../../../kernel/security/lockdown").lexically_normal());
  return line.find('[') != std::string::npos && line.find("[none]") == std::string::npos;
}

/// An access would reach something else than the card. A device that is not enabled may still take accesses: the
/// kernel's `enable` counts users, and 0 does not switch the ports off.
Obstacles port_obstacles(const fs::path& device) {
  const BarInfo bar = read_bar2(device);
  if (bar.bytes == 0 || (!bar.unset && !bar.disabled)) return {};
  return {{std::string("its I/O ports (BAR 2) are ") + (bar.unset ? "not assigned" : "disabled") +
               ": an access would reach other devices of this computer",
           "shut down and put the card into another slot, or let the BIOS assign resources (\"PnP OS\" off); "
           "lspci -vv shows region 2"}};
}

/// What the kernel's files say against driving the card in this folder: its ports lead elsewhere or nowhere, another
/// driver owns it, or the kernel takes no writes. Accesses no register. Throws Unavailable if the table of regions
/// cannot be read.
Obstacles card_obstacles(const fs::path& device) {
  Obstacles found = port_obstacles(device);
  if (number_in(device / "enable", 10) == 0) {
    found.push_back({"not enabled", "echo 1 | sudo tee " + device.string() + "/enable"});
  }
  std::error_code none_bound;
  const fs::path bound = fs::read_symlink(device / "driver", none_bound);
  if (!none_bound) {
    found.push_back({"owned by the kernel driver " + bound.filename().string(),
                     "echo " + device.filename().string() + " | sudo tee " + device.string() + "/driver/unbind"});
  }
  if (is_locked_down(device.parent_path())) {
    found.push_back({"the kernel is locked down (Secure Boot) and refuses every write to I/O ports",
                     "switch Secure Boot off in the computer's firmware, or boot without lockdown=; cat "
                     "/sys/kernel/security/lockdown shows it"});
  }
  return found;
}

void refuse_obstacles(const fs::path& folder, const Obstacles& obstacles) {
  if (obstacles.empty()) return;
  const FoundBoard::Obstacle& first = obstacles.front();
  refuse("card " + folder.string() + ": " + first.what + "; nothing was written. " + first.fix);
}

Obstacles obstacles_or_error(const fs::path& device) try {
  check_bar2(device);
  return card_obstacles(device);
} catch (const Unavailable& error) {
  return {{error.what(), "compare with lspci -vv (docs/rig-setup.md)"}};
}

/// Without a lock: a run may have the card. No other register shows reliably that the card is absent.
bool answers_all_ones(const std::string& file) try {
  std::uint32_t version = 0;
  return open_window(file, WindowUse::beside_guardian)->read32(reg::bitstream_version, version).ok() &&
         version == all_ones;
} catch (const Unavailable&) {
  return false;
}

FoundBoard surveyed(const fs::path& device) {
  const std::string file = (device / "resource2").string();
  FoundBoard board{.what = "RT-DAC4/PCI at " + device.filename().string(),
                   .selection = {"driver.pci.bdf=" + device.filename().string()},
                   .files = {file},
                   .obstacles = obstacles_or_error(device)};
  if (!can_be_opened(file)) {
    board.obstacles.push_back(
        {"registers not accessible to this user", "sudo chgrp abs_hil " + file + " && sudo chmod g+rw " + file +
                                                      "; for good: the udev rule of docs/rig-setup.md"});
  }
  if (board.obstacles.empty() && answers_all_ones(file)) {
    board.obstacles.push_back(
        {"answers all ones: it is not on the bus", "check its power, its slot and that its I/O decoding is enabled"});
  }
  if (board.obstacles.empty()) board.detail = "no kernel driver, enabled, registers accessible";
  return board;
}

}  // namespace

std::vector<std::string> find_cards(const fs::path& root) {
  std::error_code error;
  std::vector<std::string> cards;
  fs::directory_iterator entries(root, error);
  if (error) {
    refuse("cannot look for PCI devices in " + root.string() + " (driver.pci.root): " +
           rig::refusal(error.value(), root, rig::reading) + ". To run without the rig, use --backend sim");
  }
  for (const fs::directory_iterator end; entries != end && !error; entries.increment(error)) {
    if (is_the_card(entries->path())) cards.push_back(entries->path().filename().string());
  }
  std::sort(cards.begin(), cards.end());
  return cards;
}

std::vector<FoundBoard> survey_cards(const PciOptions& options) try {
  std::vector<FoundBoard> boards;
  for (const std::string& address : find_cards(options.root)) {
    if (options.bdf.empty() || options.bdf == address) boards.push_back(surveyed(fs::path(options.root) / address));
  }
  return boards;
} catch (const Unavailable&) {
  return {};  // no folder of PCI devices
}

Card open_card(const PciOptions& options, bool lock_step) {
  const std::string bdf = choose(options);
  const fs::path folder = fs::path(options.root) / bdf;
  check_bar2(folder);
  refuse_obstacles(folder, card_obstacles(folder));
  std::error_code ignored;
  require_lock_step("the card in " + folder.string(), lock_step, fs::exists(folder / emulated_time_file, ignored));
  Card card{.window = open_window(folder / "resource2"), .place = bdf + " in " + options.root, .address = bdf};
  if (lock_step) card.time = open_emulated_time(folder / emulated_time_file);
  return card;
}

std::unique_ptr<RegisterWindow> open_beside_owner(const PciOptions& options, bool beside_guardian, std::string* file) {
  const fs::path folder = fs::path(options.root) / choose(options);
  if (file != nullptr) *file = (folder / "resource2").string();
  check_bar2(folder);
  refuse_obstacles(folder, port_obstacles(folder));
  return open_window(folder / "resource2", beside_guardian ? WindowUse::beside_guardian : WindowUse::guardian);
}

}  // namespace abs_hil::driver::pci

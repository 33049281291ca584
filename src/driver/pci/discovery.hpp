#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "driver/pci/options.hpp"
#include "driver/pci/register_window.hpp"

namespace abs_hil::driver::pci {

/// A card ready for use.
struct Card {
  std::unique_ptr<RegisterWindow> window{};
  std::unique_ptr<EmulatedTime> time{};  ///< only behind an emulator in lock-step
  std::string place{};                   ///< for messages: address and folder
};

/// The addresses ("0000:03:00.0") of all cards with the right vendor and device below `root`, sorted. Throws
/// Unavailable if `root` cannot be read.
[[nodiscard]] std::vector<std::string> find_cards(const std::filesystem::path& root);

/// BAR 2 as sysfs' `resource` describes it.
struct BarInfo {
  std::uint64_t bytes{0};
  bool io_ports{false};
};
/// Throws Unavailable if the file cannot be read as a table of regions.
[[nodiscard]] BarInfo read_bar2(const std::filesystem::path& device_folder);

/// Finds the card that the options mean, checks device, kind and size of its BAR, opens and locks it. Nothing is
/// written. Throws Unavailable with the cause and what mends it.
/// @param lock_step  the emulator's clock is to be driven: refused where there is none, as on all hardware; without it
///                   an emulator that waits for lock-step is refused
[[nodiscard]] Card open_card(const PciOptions& options, bool lock_step);

/// The registers of the same card for a guardian: found and checked in the same way, not locked as an owner locks them.
/// Throws Unavailable; also if another guardian still makes that card safe.
[[nodiscard]] std::unique_ptr<RegisterWindow> open_beside_owner(const PciOptions& options);

/// Beside the card's files in an emulator in lock-step, and never on hardware.
inline constexpr const char* emulated_time_file = "emulated_time_ns";

}  // namespace abs_hil::driver::pci

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
  std::unique_ptr<EmulatedTime> time{};  ///< only for an emulator in lock-step
  std::string place{};                   ///< for messages: address and folder
  std::string address{};                 ///< "0000:03:00.0"
};

/// The addresses ("0000:03:00.0") of all cards with the right vendor and device below `root`, sorted. Throws
/// Unavailable if `root` cannot be read.
[[nodiscard]] std::vector<std::string> find_cards(const std::filesystem::path& root);

/// BAR 2 as sysfs' `resource` describes it.
struct BarInfo {
  std::uint64_t bytes{0};
  bool io_ports{false};
  bool unset{false};     ///< neither firmware nor kernel has given it an address
  bool disabled{false};  ///< the kernel has switched it off
};
/// Throws Unavailable if the file cannot be read as a table of regions.
[[nodiscard]] BarInfo read_bar2(const std::filesystem::path& device_folder);

/// Throws Unavailable unless BAR 2 has the kind and size of the card's.
void check_bar2(const std::filesystem::path& device_folder);

/// Finds the card that the options select. Checks its ids, what the kernel says against it (card_obstacles.hpp) and the
/// kind and size of its BAR, then opens and locks it. Writes nothing. Throws Unavailable with cause and fix.
/// @param lock_step  advance the emulator's clock; refused without such a clock, as on all hardware. If false, an
///                   emulator in lock-step is refused
[[nodiscard]] Card open_card(const PciOptions& options, bool lock_step);

/// Opens the registers of the same card for a guardian. Finds and checks the card in the same way, but without the
/// owner's lock. Throws Unavailable, also if another guardian still makes that card safe.
/// @param beside_guardian  go on even then: both write zeros only
/// @param file  becomes the file of the registers as soon as the card is found; null: not asked for
[[nodiscard]] std::unique_ptr<RegisterWindow> open_beside_owner(const PciOptions& options, bool beside_guardian = false,
                                                                std::string* file = nullptr);

/// File in the card's folder that only an emulator in lock-step has.
inline constexpr const char* emulated_time_file = "emulated_time_ns";

}  // namespace abs_hil::driver::pci

// Finds the RT-DAC4/PCI in sysfs and says what keeps a run from using it.

#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "driver/board_options.hpp"
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

/// What the kernel's files say against driving the card in this folder: its ports lead elsewhere or nowhere, another
/// driver owns it, or the kernel takes no writes. Accesses no register. Empty if nothing does. Throws Unavailable if
/// the table of regions cannot be read.
[[nodiscard]] std::vector<FoundBoard::Obstacle> card_obstacles(const std::filesystem::path& device_folder);

/// True if the kernel of this tree of files is locked down and refuses to write to I/O ports.
[[nodiscard]] bool is_locked_down(const std::filesystem::path& devices_folder);

/// The cards that the options do not exclude, with what keeps a run from using them. Accesses no register. Empty if
/// there is no card, or no folder of PCI devices.
[[nodiscard]] std::vector<FoundBoard> survey_cards(const PciOptions& options);

/// Finds the card that the options select. Checks its ids, what the kernel says against it and the kind and size of its
/// BAR, then opens and locks it. Writes nothing. Throws Unavailable with cause and fix.
/// @param lock_step  advance the emulator's clock; refused without such a clock, as on all hardware. If false, an
///                   emulator in lock-step is refused
[[nodiscard]] Card open_card(const PciOptions& options, bool lock_step);

/// Opens the registers of the same card for a guardian, without the owner's lock. Of the obstacles only those count
/// that concern the ports: the others do not keep zeros from a card. Throws Unavailable, also if another guardian still
/// makes that card safe.
/// @param beside_guardian  go on even then: both write zeros only
/// @param file  becomes the file of the registers as soon as the card is found; null: not asked for
[[nodiscard]] std::unique_ptr<RegisterWindow> open_beside_owner(const PciOptions& options, bool beside_guardian = false,
                                                                std::string* file = nullptr);

/// File in the card's folder that only an emulator in lock-step has.
inline constexpr const char* emulated_time_file = "emulated_time_ns";

}  // namespace abs_hil::driver::pci

#pragma once

#include <filesystem>
#include <vector>

#include "abs_hil/driver/backend.hpp"

namespace abs_hil::driver::pci {

/// What the kernel's files say against driving the card in this folder: its ports lead elsewhere or nowhere, another
/// driver owns it, or the kernel takes no writes. Accesses no register. Empty if nothing does. Throws Unavailable if
/// the table of regions cannot be read.
[[nodiscard]] std::vector<FoundBoard::Obstacle> card_obstacles(const std::filesystem::path& device_folder);

/// Those of them that concern the ports themselves: an access would reach something else than the card. The others do
/// not keep zeros from a card. A device that is not enabled may still take accesses: the kernel's `enable` counts
/// users, and 0 does not switch the ports off.
[[nodiscard]] std::vector<FoundBoard::Obstacle> port_obstacles(const std::filesystem::path& device_folder);

/// True if the kernel of this tree of files is locked down and refuses to write to I/O ports.
[[nodiscard]] bool is_locked_down(const std::filesystem::path& devices_folder);

}  // namespace abs_hil::driver::pci

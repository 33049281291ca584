#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "diagnosis/finding.hpp"
#include "driver/usb/discovery.hpp"

namespace abs_hil::diagnosis {

/// An RT-DAC4/PCI in this computer: PLX 9030 bridge, vendor 0x10B5, device 0x2497.
struct PciBoard {
  std::string address;             ///< domain:bus:device.function, as lspci -D shows it
  std::filesystem::path folder{};  ///< its files in sysfs
  std::string bound_driver;        ///< kernel driver that owns it; empty: none, as it should be
  bool enabled{false};             ///< its I/O ports answer
  bool accessible{false};          ///< this process may read and write its registers (resource2)
};

/// @param devices where the kernel, or an emulator, shows PCI devices (`driver.pci.root`)
[[nodiscard]] std::vector<PciBoard> find_pci_boards(const std::filesystem::path& devices);
/// Findings of the check "boards": each board with its driver binding and access. No board is a note.
[[nodiscard]] std::vector<Finding> judge(const std::vector<PciBoard>& boards);

/// The same for USB boards; each names the board, that it is not verified on hardware, and whether it may be opened.
[[nodiscard]] std::vector<Finding> judge(const std::vector<driver::usb::UsbDevice>& boards);

}  // namespace abs_hil::diagnosis

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
  std::string bound_driver;        ///< kernel driver that owns it; empty: none, as required
  bool enabled{false};             ///< the device is enabled
  bool accessible{false};          ///< this process may read and write its registers (resource2)
};

/// @param devices  folder in which the kernel or an emulator shows PCI devices (`driver.pci.root`)
[[nodiscard]] std::vector<PciBoard> find_pci_boards(const std::filesystem::path& devices);
/// Findings of the check "boards": each board with its driver binding and access. A missing board is a note.
[[nodiscard]] std::vector<Finding> judge(const std::vector<PciBoard>& boards);

/// The same for USB boards. Each finding gives the board, a note that it is not verified on hardware, and whether this
/// process may open it.
[[nodiscard]] std::vector<Finding> judge(const std::vector<driver::usb::UsbDevice>& boards);

}  // namespace abs_hil::diagnosis

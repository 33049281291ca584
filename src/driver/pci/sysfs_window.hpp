#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "driver/file_descriptor.hpp"
#include "driver/pci/register_window.hpp"

namespace abs_hil::driver::pci {

using driver::FileDescriptor;

/// Who opens a card's registers. A guardian stands beside the owner until that is gone, and keeps new owners away from
/// then on: it holds a lock of another sort (fcntl), which an owner looks for.
enum class WindowUse : std::uint8_t { owner, guardian };

/// The registers behind sysfs' `resource2`: for an I/O BAR the kernel turns a 4-byte pread or pwrite at the register's
/// offset into one 32-bit port access (Documentation/PCI/sysfs-pci.rst). Exactly one process may own a card, because
/// index and data are two accesses: the file stays locked (flock) as long as this lives.
class SysfsWindow final : public RegisterWindow {
 public:
  /// Opens and locks the file. Throws Unavailable: not there, not permitted (with the udev rule that mends it), or
  /// owned, or still made safe, by another process (with its id).
  explicit SysfsWindow(const std::filesystem::path& resource_file, WindowUse use = WindowUse::owner);

  IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override;
  IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override;

 private:
  FileDescriptor file_;
};

/// The emulator's clock as a file beside the card's: 8 bytes, the time in ns. Reading tells it, writing advances it.
class EmulatedTimeFile final : public EmulatedTime {
 public:
  /// Throws Unavailable if the file is not there or cannot be opened.
  explicit EmulatedTimeFile(const std::filesystem::path& file);

  IoResult now(std::int64_t& time_ns) noexcept override;
  IoResult advance_to(std::int64_t time_ns) noexcept override;

 private:
  FileDescriptor file_;
};

/// What an errno of pread or pwrite says about the card.
[[nodiscard]] IoError io_error_for(int errno_value) noexcept;

}  // namespace abs_hil::driver::pci

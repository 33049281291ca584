// The wire of the RT-DAC4/PCI: 32-bit registers behind a file of sysfs, with one owner.

#pragma once

#include <cstdint>
#include <filesystem>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/file_descriptor.hpp"

namespace abs_hil::driver::pci {

/// The 32-bit registers of one card, by byte offset from the start of its BAR. Real-time safe: no exception, allocation
/// or lock; each access takes as long as the bus.
class RegisterWindow {
 public:
  RegisterWindow() = default;
  RegisterWindow(const RegisterWindow&) = delete;
  RegisterWindow& operator=(const RegisterWindow&) = delete;
  virtual ~RegisterWindow() = default;

  /// `value` does not change on error. `IoResult::where` is the offset.
  virtual IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept = 0;
  virtual IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept = 0;
  /// Of a guardian's window: whether new owners are refused.
  virtual void refuse_owners(bool /*refuse*/) noexcept {}
};

using driver::EmulatedTime;

using driver::FileDescriptor;

/// Who opens a card's registers. A guardian opens them beside the owner, and keeps new owners away after the owner's
/// end: it holds another kind of lock (fcntl), for which a new owner checks. `beside_guardian` takes no lock.
enum class WindowUse : std::uint8_t { owner, guardian, beside_guardian };

/// The registers behind sysfs' `resource2`. For an I/O BAR the kernel turns a 4-byte pread or pwrite at the register's
/// offset into one 32-bit port access (Documentation/PCI/sysfs-pci.rst). Only one process may own a card, because index
/// and data are two accesses. The file stays locked (flock) during this object's lifetime.
class SysfsWindow final : public RegisterWindow {
 public:
  /// Opens and locks the file. Throws Unavailable if the file is missing, if access is not permitted (with the udev
  /// rule that fixes it), or if another process owns the card or still makes it safe (with its id).
  explicit SysfsWindow(const std::filesystem::path& resource_file, WindowUse use = WindowUse::owner);

  IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept override;
  IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept override;
  void refuse_owners(bool refuse) noexcept override;

 private:
  FileDescriptor file_;
};

/// The emulator's clock: a file of 8 bytes in the card's folder, the time in ns. A write advances the time.
class EmulatedTimeFile final : public EmulatedTime {
 public:
  /// Throws Unavailable if the file is missing or cannot be opened.
  explicit EmulatedTimeFile(const std::filesystem::path& file);

  IoResult now(std::int64_t& time_ns) noexcept override;
  IoResult advance_to(std::int64_t time_ns) noexcept override;

 private:
  FileDescriptor file_;
};

/// The error that an errno of pread or pwrite means.
[[nodiscard]] IoError io_error_for(int errno_value) noexcept;

}  // namespace abs_hil::driver::pci

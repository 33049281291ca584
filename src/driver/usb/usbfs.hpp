#pragma once

#include <cstdint>
#include <span>

namespace abs_hil::driver::usb {

/// The system calls on a USB device's node (the kernel's usbfs), so that tests can take the kernel's place. A negative
/// result is -errno. As real-time safe as the kernel below it.
class Usbfs {
 public:
  Usbfs() = default;
  Usbfs(const Usbfs&) = delete;
  Usbfs& operator=(const Usbfs&) = delete;
  virtual ~Usbfs() = default;

  /// Opens the node for reading and writing; returns its file descriptor.
  virtual int open(const char* node) noexcept = 0;
  /// Closes the node: the kernel cancels its transfers and releases its interfaces.
  virtual void close(int file) noexcept = 0;
  /// Reads the device's descriptors, from where the last call ended; returns the number of bytes, 0 at the end.
  virtual std::int64_t read(int file, std::span<std::uint8_t> bytes) noexcept = 0;
  /// @param request one of the USBDEVFS_... of linux/usbdevice_fs.h
  virtual int ioctl(int file, unsigned long request, void* argument) noexcept = 0;
  /// Waits until a transfer has ended or the device is gone, at most `timeout_ns` > 0. May return earlier.
  virtual void wait(int file, std::int64_t timeout_ns) noexcept = 0;
  /// Monotonic clock.
  virtual std::int64_t now_ns() noexcept = 0;
};

/// The kernel itself. Its calls allocate nothing and take no lock in this process.
[[nodiscard]] Usbfs& kernel_usbfs() noexcept;

}  // namespace abs_hil::driver::usb

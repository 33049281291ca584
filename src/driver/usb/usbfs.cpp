#include "driver/usb/usbfs.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver::usb {

namespace {

class KernelUsbfs final : public Usbfs {
 public:
  int open(const char* node) noexcept override {
    const int file = ::open(node, O_RDWR | O_CLOEXEC);
    return file >= 0 ? file : -errno;
  }
  void close(int file) noexcept override { ::close(file); }
  std::int64_t read(int file, std::span<std::uint8_t> bytes) noexcept override {
    const ssize_t got = ::read(file, bytes.data(), bytes.size());
    return got >= 0 ? got : -errno;
  }
  int ioctl(int file, unsigned long request, void* argument) noexcept override {
    const int result = ::ioctl(file, request, argument);
    return result >= 0 ? result : -errno;
  }
  void wait(int file, std::int64_t timeout_ns) noexcept override {
    pollfd waiting{file, POLLOUT, 0};  // usbfs: writable means that a transfer has ended
    const timespec limit{static_cast<time_t>(timeout_ns / rig::ns_per_s),
                         static_cast<long>(timeout_ns % rig::ns_per_s)};
    static_cast<void>(::ppoll(&waiting, 1, &limit, nullptr));
  }
  std::int64_t now_ns() noexcept override { return monotonic_ns(); }
};

}  // namespace

Usbfs& kernel_usbfs() noexcept {
  static KernelUsbfs kernel;
  return kernel;
}

}  // namespace abs_hil::driver::usb

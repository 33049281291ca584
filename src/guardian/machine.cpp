// What the service hears of its machine: systemd's socket, and pauses of a virtual machine.
#include "guardian/machine.hpp"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "driver/monotonic_time.hpp"
#include "driver/sysfs.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::guardian {

namespace {

using rig::ns_per_s;

constexpr std::int64_t least_pause_ns = ns_per_s / 2;
/// Longer than any pause: somebody has set the clock.
constexpr std::int64_t longest_pause_ns = 43'200 * ns_per_s;
constexpr std::int64_t drift_divisor = 1000;

/// A socket connected to systemd's, made once. A path that begins with '@' is in the abstract namespace.
int open_socket() noexcept {
  const char* const path = std::getenv("NOTIFY_SOCKET");  // NOLINT(concurrency-mt-unsafe): before any thread
  sockaddr_un address{};
  if (path == nullptr || *path == '\0' || std::strlen(path) >= sizeof address.sun_path) return -1;
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return -1;
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path, std::strlen(path) + 1);
  if (*path == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + std::strlen(path));
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return fd;
  ::close(fd);
  return -1;
}

}  // namespace

int systemd_socket() noexcept {
  static const int fd = open_socket();
  return fd;
}

void tell_systemd(std::string_view message) noexcept {
  if (systemd_socket() < 0) return;
  static_cast<void>(::send(systemd_socket(), message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
}

Event::Event() : file_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

void Event::signal() const noexcept {
  constexpr std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(file_.get(), &one, sizeof one);
}

bool Event::take() const noexcept {
  std::uint64_t count = 0;
  return ::read(file_.get(), &count, sizeof count) == sizeof count;
}

bool ClockLead::leapt(std::int64_t clock_s, std::int64_t monotonic_ns) noexcept {
  const std::int64_t least_ns = clock_s * ns_per_s - monotonic_ns;
  const std::int64_t most_ns = least_ns + ns_per_s;
  const std::int64_t ahead_ns = least_ns - most_ns_;
  const std::int64_t drift_ns = (monotonic_ns - looked_ns_) / drift_divisor;
  looked_ns_ = monotonic_ns;
  if (first_ || ahead_ns > least_pause_ns) {
    most_ns_ = most_ns;
    return !std::exchange(first_, false) && ahead_ns < longest_pause_ns;
  }
  most_ns_ = std::min(most_ns, most_ns_ + drift_ns);
  return false;
}

MachinePause::MachinePause(std::function<void()> found) : found_(std::move(found)) {
  if (driver::value_in("/proc/cpuinfo", "flags").find(" hypervisor") == std::string::npos) return;
  // Not /dev/rtc0: only one process may have that open.
  clock_ = driver::FileDescriptor(::open("/sys/class/rtc/rtc0/since_epoch", O_RDONLY | O_CLOEXEC));
  if (!works()) return;
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

std::int64_t MachinePause::clock_s() const {
  std::array<char, 32> text{};
  const ssize_t size = ::pread(clock_.get(), text.data(), text.size(), 0);
  std::int64_t seconds = -1;
  if (size > 0) std::from_chars(text.data(), text.data() + size, seconds);
  return seconds;
}

void MachinePause::watch(const std::stop_token& stop) {
  using std::chrono::milliseconds;
  runtime::keep_signals_away();
  while (!stop.stop_requested()) {
    if (const std::int64_t now_s = clock_s(); now_s >= 0 && lead_.leapt(now_s, driver::monotonic_ns())) {
      if (leased_) found_();
      happened_.signal();
    }
    std::this_thread::sleep_for(leased_ ? milliseconds(1) : milliseconds(100));
  }
}

}  // namespace abs_hil::guardian

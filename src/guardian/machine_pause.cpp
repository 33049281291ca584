// Notices that the whole machine stood still.
#include "guardian/machine_pause.hpp"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <fstream>
#include <string>
#include <utility>

#include "driver/monotonic_time.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::guardian {

namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;
constexpr std::int64_t least_pause_ns = ns_per_s / 2;
/// Longer than any pause: somebody has set the clock.
constexpr std::int64_t longest_pause_ns = 43'200 * ns_per_s;
constexpr std::int64_t drift_divisor = 1000;

bool in_a_virtual_machine() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string word; file >> word;) {
    if (word == "hypervisor") return true;
  }
  return false;
}

}  // namespace

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
  if (!in_a_virtual_machine()) return;
  // Not /dev/rtc0: only one process may have that open.
  clock_ = driver::FileDescriptor(::open("/sys/class/rtc/rtc0/since_epoch", O_RDONLY | O_CLOEXEC));
  if (!works()) return;
  happened_ = driver::FileDescriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  thread_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

std::int64_t MachinePause::clock_s() const {
  std::array<char, 32> text{};
  const ssize_t size = ::pread(clock_.get(), text.data(), text.size(), 0);
  std::int64_t seconds = -1;
  if (size > 0) std::from_chars(text.data(), text.data() + size, seconds);
  return seconds;
}

bool MachinePause::paused() {
  const std::int64_t now_s = clock_s();
  return now_s >= 0 && lead_.leapt(now_s, driver::monotonic_ns());
}

void MachinePause::watch(const std::stop_token& stop) {
  using std::chrono::milliseconds;
  runtime::keep_signals_away();
  while (!stop.stop_requested()) {
    if (paused()) {
      if (leased_) found_();
      constexpr std::uint64_t one = 1;
      [[maybe_unused]] const auto written = ::write(happened_.get(), &one, sizeof one);
    }
    std::this_thread::sleep_for(leased_ ? milliseconds(1) : milliseconds(100));
  }
}

Interruption MachinePause::interruption() {
  return {.descriptor = happened_.get(),
          .take =
              [this] {
                std::uint64_t count = 0;
                [[maybe_unused]] const auto got = ::read(happened_.get(), &count, sizeof count);
                return rig::Reason::none;  // the guard knows: it need only look
              },
          .lease_changed = [this](bool held) { leased_ = held; }};
}

}  // namespace abs_hil::guardian

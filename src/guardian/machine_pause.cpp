#include "guardian/machine_pause.hpp"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <unistd.h>

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

/// By how much the real-time clock must be ahead.
constexpr std::int64_t least_pause_ns = 500'000'000;
constexpr std::int64_t ns_per_s = 1'000'000'000;
/// Longer than any pause: somebody has set the clock.
constexpr std::int64_t longest_pause_s = 43'200;

bool in_a_virtual_machine() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string word; file >> word;) {
    if (word == "hypervisor") return true;
  }
  return false;
}

}  // namespace

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
  const std::int64_t now_ns = driver::monotonic_ns();
  if (now_s < 0 || now_s == last_clock_s_) return false;
  // The first reading may come late in its second: only the time from one change to the next is known.
  const bool first = last_clock_s_ < 0 || !std::exchange(saw_change_, last_clock_s_ >= 0);
  const std::int64_t went_on_s = now_s - last_clock_s_;
  const std::int64_t lead_ns = went_on_s * ns_per_s - (now_ns - last_change_ns_);
  last_clock_s_ = now_s;
  last_change_ns_ = now_ns;
  return !first && lead_ns > least_pause_ns && went_on_s < longest_pause_s;
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

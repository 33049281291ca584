#include "machine_pause.hpp"

#include <fcntl.h>
#include <linux/rtc.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <ctime>
#include <fstream>
#include <string>

#include "driver/monotonic_time.hpp"

namespace abs_hil::app {

namespace {

/// What a pause adds to the real-time clock, at least. Its interrupts come once a second.
constexpr std::int64_t least_pause_ns = 500'000'000;
constexpr std::int64_t ns_per_s = 1'000'000'000;

bool in_a_virtual_machine() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string word; file >> word;) {
    if (word == "hypervisor") return true;
  }
  return false;
}

}  // namespace

MachinePause::MachinePause() {
  if (!in_a_virtual_machine()) return;
  driver::FileDescriptor clock(::open("/dev/rtc0", O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (clock.get() < 0 || ::ioctl(clock.get(), RTC_UIE_ON, 0) != 0) return;
  clock_ = std::move(clock);
}

std::int64_t MachinePause::clock_s() const {
  rtc_time time{};
  if (::ioctl(clock_.get(), RTC_RD_TIME, &time) != 0) return -1;
  std::tm utc{};
  utc.tm_sec = time.tm_sec;
  utc.tm_min = time.tm_min;
  utc.tm_hour = time.tm_hour;
  utc.tm_mday = time.tm_mday;
  utc.tm_mon = time.tm_mon;
  utc.tm_year = time.tm_year;
  return ::timegm(&utc);
}

rig::Reason MachinePause::look() {
  unsigned long interrupts = 0;
  [[maybe_unused]] const auto got = ::read(clock_.get(), &interrupts, sizeof interrupts);
  const std::int64_t now_s = clock_s();
  const std::int64_t now_ns = driver::monotonic_ns();
  const bool first = last_clock_s_ < 0 || now_s < 0;
  const std::int64_t lead_ns = (now_s - last_clock_s_) * ns_per_s - (now_ns - last_monotonic_ns_);
  last_clock_s_ = now_s;
  last_monotonic_ns_ = now_ns;
  return !first && lead_ns > least_pause_ns ? rig::Reason::machine_paused : rig::Reason::none;
}

guardian::Interruption MachinePause::interruption() {
  return {.descriptor = clock_.get(), .take = [this] { return look(); }};
}

}  // namespace abs_hil::app

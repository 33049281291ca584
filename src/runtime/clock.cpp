#include "runtime/clock.hpp"

#include <cerrno>
#include <ctime>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

std::int64_t MonotonicClock::now_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);  // vDSO: no system call
  return static_cast<std::int64_t>(now.tv_sec) * rig::ns_per_s + now.tv_nsec;
}

void MonotonicClock::sleep_until(std::int64_t time_ns) noexcept {
  const timespec until{static_cast<time_t>(time_ns / rig::ns_per_s), static_cast<long>(time_ns % rig::ns_per_s)};
  // clock_nanosleep returns its error. Repeat after EINTR: a signal must not shorten the period.
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace abs_hil::runtime

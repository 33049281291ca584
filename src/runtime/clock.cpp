// The clock of the cycle: CLOCK_MONOTONIC, and the time that the computer slept.
#include "runtime/clock.hpp"

#include <cerrno>
#include <ctime>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

namespace {
/// The vDSO holds both clocks (CLOCK_BOOTTIME since Linux 5.3): no system call.
std::int64_t time_ns_of(clockid_t clock) noexcept {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<std::int64_t>(now.tv_sec) * rig::ns_per_s + now.tv_nsec;
}
}  // namespace

std::int64_t MonotonicClock::now_ns() noexcept { return time_ns_of(CLOCK_MONOTONIC); }

std::int64_t MonotonicClock::suspended_ns() noexcept {
  // In this order a delay between the two calls makes the result smaller, never larger.
  const std::int64_t with_suspension_ns = time_ns_of(CLOCK_BOOTTIME);
  return with_suspension_ns - time_ns_of(CLOCK_MONOTONIC);
}

void MonotonicClock::sleep_until(std::int64_t time_ns) noexcept {
  const timespec until{static_cast<time_t>(time_ns / rig::ns_per_s), static_cast<long>(time_ns % rig::ns_per_s)};
  // clock_nanosleep returns its error. Repeat after EINTR: a signal must not shorten the period.
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace abs_hil::runtime

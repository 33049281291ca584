// Clock, real time and early end for platforms that only simulate: in place of clock.cpp, realtime_setup.cpp and
// early_end.cpp. They have no real time, no guardian and no board, so a controller that ends the program moves nothing.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "runtime/clock.hpp"
#include "runtime/early_end.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::runtime {

std::int64_t MonotonicClock::now_ns() noexcept {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::int64_t MonotonicClock::suspended_ns() noexcept { return 0; }

void MonotonicClock::sleep_until(std::int64_t time_ns) noexcept {
  std::this_thread::sleep_for(std::chrono::nanoseconds(time_ns - now_ns()));
}

Scheduling scheduling_of_this_thread() { return {}; }

bool RealtimeReport::realtime() const noexcept { return false; }

std::string RealtimeReport::shortcomings() const {
  return "  not obtained: real time, which abs_hil has on Linux only\n  to fix it:\n    run it on Linux";
}

void keep_signals_away() noexcept {}

RealtimeScope::RealtimeScope(const RealtimeOptions& /*options*/) {}
RealtimeScope::~RealtimeScope() = default;
void RealtimeScope::hold_cpu_latency() {}

EarlyEndWatch::EarlyEndWatch() = default;
EarlyEndWatch::~EarlyEndWatch() = default;

CycleInThisThread::CycleInThisThread(Outputs& outputs, bool /*own_thread*/) noexcept : before_(&outputs) {}
CycleInThisThread::~CycleInThisThread() = default;

void SlowCycleWatch::watch() {
  constexpr auto tick = std::chrono::milliseconds(100);
  constexpr int ticks_max = 50;
  std::uint64_t seen = 0;
  int same = 0;
  std::unique_lock lock(mutex_);
  while (!end_.wait_for(lock, tick, [this] { return ending_; })) {
    const std::uint64_t cycles = cycles_.load(std::memory_order_relaxed);
    same = inside_.load(std::memory_order_relaxed) && cycles == seen ? same + 1 : 0;
    seen = cycles;
    if (same <= ticks_max) continue;
    std::fputs(
        "abs_hil: fault: a cycle takes more than 5 s: the controller in this program does not return; the program "
        "ends with status 1.\n",
        stderr);
    std::_Exit(1);
  }
}

}  // namespace abs_hil::runtime

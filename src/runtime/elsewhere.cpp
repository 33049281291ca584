// Clock, real time and early end for platforms that only simulate: in place of clock.cpp, realtime_setup.cpp and
// early_end.cpp. They have no real time, no guardian and no board, so a controller that ends the program moves nothing.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
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

void end_early(std::string_view why, bool /*make_safe*/) noexcept {
  std::fprintf(stderr, "abs_hil: %s; the program ends with status 1.\n", std::string(why).c_str());
  std::_Exit(1);
}

}  // namespace abs_hil::runtime

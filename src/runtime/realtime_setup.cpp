#include "abs_hil/runtime/realtime_setup.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>

namespace abs_hil::runtime {

namespace {

RealtimeStep lock_memory() {
  RealtimeStep step{"memory locked (mlockall)", true, {}, {}};
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    step.obtained = false;
    step.detail = std::strerror(errno);
    step.fix =
        "add '@realtime - memlock unlimited' to /etc/security/limits.d/realtime.conf, join group realtime, "
        "log in again; or: sudo setcap cap_ipc_lock,cap_sys_nice+ep $(command -v abs_hil)";
  }
  return step;
}

RealtimeStep schedule_fifo(int priority) {
  RealtimeStep step{"SCHED_FIFO priority " + std::to_string(priority), true, {}, {}};
  sched_param wanted{};
  wanted.sched_priority = priority;
  int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);  // returns its error, leaves errno alone
  int policy = 0;
  sched_param got{};
  if (error == 0) error = pthread_getschedparam(pthread_self(), &policy, &got);
  if (error != 0 || policy != SCHED_FIFO || got.sched_priority != priority) {
    step.obtained = false;
    step.detail = error != 0 ? std::strerror(error) : "the kernel kept another policy";
    step.fix =
        "add '@realtime - rtprio 98' to /etc/security/limits.d/realtime.conf, join group realtime, log in "
        "again; or: sudo setcap cap_ipc_lock,cap_sys_nice+ep $(command -v abs_hil)";
  }
  return step;
}

/// Touches the stack that the cycle will use, so that no page of it is faulted in later.
void prefault_stack() {
  constexpr std::size_t stack_bytes = 256 * 1024;
  std::array<volatile unsigned char, stack_bytes> pages;
  for (std::size_t at = 0; at < stack_bytes; at += 1024) pages[at] = 0;
}

}  // namespace

bool RealtimeReport::realtime() const noexcept {
  return !steps.empty() && std::all_of(steps.begin(), steps.end(), [](const RealtimeStep& s) { return s.obtained; });
}

std::string RealtimeReport::failures() const {
  std::string text;
  for (const RealtimeStep& step : steps) {
    if (step.obtained) continue;
    if (!text.empty()) text += '\n';
    text += "not obtained: " + step.what + ": " + step.detail + "; to mend it: " + step.fix;
  }
  return text;
}

RealtimeReport set_up_realtime(const RealtimeOptions& options) {
  RealtimeReport report;
  if (options.mode == RealtimeMode::off) return report;
  report.steps.push_back(lock_memory());
  report.steps.push_back(schedule_fifo(options.priority));
  prefault_stack();
  return report;
}

}  // namespace abs_hil::runtime

#include "runtime/realtime_setup.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>

#include "runtime/memory_locking.hpp"
#include "runtime/realtime_fixes.hpp"

namespace abs_hil::runtime {

namespace {

std::string limit_text(int resource) {
  rlimit limit{};
  if (getrlimit(static_cast<__rlimit_resource>(resource), &limit) != 0) return "unknown";
  return limit.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(limit.rlim_cur);
}

RealtimeStep schedule_fifo(int priority) {
  RealtimeStep step{.what = "SCHED_FIFO priority " + std::to_string(priority)};
  sched_param wanted{};
  wanted.sched_priority = priority;
  // pthread functions return their error and leave errno alone.
  const int set_error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);
  int policy = SCHED_OTHER;
  sched_param got{};
  const int get_error = pthread_getschedparam(pthread_self(), &policy, &got);
  step.obtained = set_error == 0 && get_error == 0 && policy == SCHED_FIFO && got.sched_priority == priority;
  if (step.obtained) {
    step.detail = "read back from the scheduler";
  } else {
    step.detail = set_error != 0 ? std::strerror(set_error) : "the scheduler kept another policy";
    step.detail += " (RLIMIT_RTPRIO " + limit_text(RLIMIT_RTPRIO) + ")";
    step.fix = fifo_fix(priority);
  }
  return step;
}

RealtimeStep bind_to_cpu(int cpu) {
  RealtimeStep step{.what = "bound to CPU " + std::to_string(cpu)};
  cpu_set_t wanted;
  CPU_ZERO(&wanted);
  CPU_SET(static_cast<std::size_t>(cpu), &wanted);
  const int set_error = pthread_setaffinity_np(pthread_self(), sizeof wanted, &wanted);
  cpu_set_t got;
  CPU_ZERO(&got);
  const int get_error = pthread_getaffinity_np(pthread_self(), sizeof got, &got);
  step.obtained = set_error == 0 && get_error == 0 && CPU_EQUAL(&wanted, &got);
  if (step.obtained) {
    step.detail = "runs on CPU " + std::to_string(sched_getcpu());
  } else {
    step.detail = set_error == EINVAL ? "this CPU does not exist, or this process may not use it"
                                      : std::strerror(set_error != 0 ? set_error : get_error);
    step.fix = "taskset -cp $$   # shows the CPUs that may be used; then --set realtime.cpu=N, or -1 for any";
  }
  return step;
}

RealtimeStep least_timer_slack() {
  RealtimeStep step{.what = "timer slack 1 ns", .required = false};
  constexpr unsigned long least_ns = 1;  // 0 would mean the default, 50 us
  const int set = prctl(PR_SET_TIMERSLACK, least_ns, 0, 0, 0);
  const int error = errno;
  const int got_ns = prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0);
  step.obtained = set == 0 && got_ns >= 0 && got_ns <= static_cast<int>(least_ns);
  step.detail = set == 0 ? "slack is " + std::to_string(got_ns) + " ns" : std::strerror(error);
  if (!step.obtained) step.fix = "no fix needed: timer slack does not apply under SCHED_FIFO";
  return step;
}

}  // namespace

bool RealtimeReport::realtime() const noexcept {
  return !steps.empty() &&
         std::all_of(steps.begin(), steps.end(), [](const RealtimeStep& s) { return s.obtained || !s.required; });
}

std::string RealtimeReport::shortcomings() const {
  std::string text;
  std::vector<std::string_view> fixes;
  for (const RealtimeStep& step : steps) {
    if (step.obtained) continue;
    text += "  not obtained" + std::string(step.required ? "" : " (helpful, not required)") + ": " + step.what + ": " +
            step.detail + "\n";
    if (std::find(fixes.begin(), fixes.end(), step.fix) == fixes.end()) fixes.push_back(step.fix);
  }
  if (text.empty()) return text;
  text += "  to fix it:";
  for (const std::string_view fix : fixes) {
    text += "\n    ";
    for (const char c : fix) text += c == '\n' ? std::string("\n    ") : std::string(1, c);
  }
  return text;
}

void keep_signals_away() noexcept {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, nullptr);  // cannot fail with these arguments
}

RealtimeScope::RealtimeScope(const RealtimeOptions& options) {
  if (options.mode == RealtimeMode::off) {
    report_.scheduling = scheduling_of_this_thread();
    return;
  }
  report_.steps.push_back(lock_memory());
  report_.steps.push_back(prefault_heap());
  report_.steps.push_back(prefault_stack());
  if (options.cpu >= 0) report_.steps.push_back(bind_to_cpu(options.cpu));
  // Set the slack before SCHED_FIFO: a real-time thread has none.
  report_.steps.push_back(least_timer_slack());
  report_.steps.push_back(schedule_fifo(options.priority));
  hold_cpu_latency();
  report_.scheduling = scheduling_of_this_thread();
}

RealtimeScope::~RealtimeScope() {
  if (cpu_latency_file_ >= 0) ::close(cpu_latency_file_);
}

// As long as this file is open, the kernel keeps the CPUs in idle states whose exit latency is at most the value
// written (us): Documentation/power/pm_qos_interface.rst.
void RealtimeScope::hold_cpu_latency() {
  constexpr const char* device = "/dev/cpu_dma_latency";
  RealtimeStep step{.what = std::string(device) + " held at 0", .required = false};
  errno = 0;
  cpu_latency_file_ = ::open(device, O_RDWR | O_CLOEXEC);
  constexpr std::int32_t none_us = 0;
  std::int32_t got_us = -1;
  const bool written = cpu_latency_file_ >= 0 && ::write(cpu_latency_file_, &none_us, sizeof none_us) == sizeof none_us;
  const int error = errno;
  step.obtained = written && ::pread(cpu_latency_file_, &got_us, sizeof got_us, 0) == sizeof got_us && got_us == 0;
  if (step.obtained) {
    step.detail = "the kernel's limit reads 0 us";
  } else {
    step.detail = written ? "the kernel's limit is still " + std::to_string(got_us) + " us" : std::strerror(error);
    step.fix = error == ENOENT ? "no fix: this kernel has no CPU latency control (CONFIG_CPU_IDLE)" : cpu_latency_fix();
  }
  report_.steps.push_back(std::move(step));
}

}  // namespace abs_hil::runtime

// Makes the process real-time: scheduling, locked memory, processor, C-states; with the fix for each failure.
#include "runtime/realtime_setup.hpp"

#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#include "driver/sysfs.hpp"

namespace abs_hil::runtime {

namespace {

/// setcap's words for this program and the guardian beside it: a guardian with fewer rights than its controller is
/// refused. setcap takes the capabilities anew before each file.
std::string capabilities_for_programs() {
  const auto words = [](const std::string& path) { return "cap_sys_nice,cap_ipc_lock+ep \"" + path + '"'; };
  std::array<char, 4096> path{};
  const ssize_t size = ::readlink("/proc/self/exe", path.data(), path.size());
  if (size <= 0) return words("$(command -v abs_hil)") + ' ' + words("$(command -v abs_guardian)");
  const std::string program(path.data(), static_cast<std::size_t>(size));
  const std::string guardian = program.substr(0, program.rfind('/') + 1) + "abs_guardian";
  const bool has_guardian = guardian != program && ::access(guardian.c_str(), F_OK) == 0;
  return has_guardian ? words(program) + ' ' + words(guardian) : words(program);
}

/// Shell commands that permit this program SCHED_FIFO and locked memory permanently.
std::string privilege_fix() {
  return "sudo groupadd -f realtime && sudo usermod -aG realtime $USER\n"
         "printf '@realtime - rtprio 98\\n@realtime - memlock unlimited\\n' | sudo tee "
         "/etc/security/limits.d/99-realtime.conf   # then log in again\n"
         "or, for these programs alone: sudo setcap " +
         capabilities_for_programs();
}

/// The same commands, and fixes for other causes that keep the scheduler from granting `priority`.
std::string fifo_fix(int priority) {
  rlimit limit{};
  if (getrlimit(RLIMIT_RTPRIO, &limit) == 0 && limit.rlim_cur > 0 && limit.rlim_cur < static_cast<rlim_t>(priority)) {
    return "--set realtime.priority=" + std::to_string(limit.rlim_cur) + ", which the limit allows, or:\n" +
           privilege_fix();
  }
  if (::geteuid() == 0) {
    // Root can fail in a container without CAP_SYS_NICE, or in a control group without real-time bandwidth.
    return "in a container: docker run --cap-add SYS_NICE --cap-add IPC_LOCK --ulimit rtprio=98 --ulimit memlock=-1 "
           "...\n"
           "in a control group without real-time bandwidth: sudo sysctl -w kernel.sched_rt_runtime_us=-1\n" +
           privilege_fix();
  }
  return privilege_fix();
}

/// Shell commands that let the group realtime open /dev/cpu_dma_latency.
std::string cpu_latency_fix() {
  return "echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"realtime\", MODE=\"0660\"' | sudo tee "
         "/etc/udev/rules.d/99-cpu-dma-latency.rules\n"
         "sudo udevadm control --reload && sudo udevadm trigger --name-match=cpu_dma_latency";
}

constexpr std::size_t heap_bytes = 4U << 20U;
constexpr std::size_t stack_bytes = 256U << 10U;
constexpr std::size_t page_bytes = 4096;

/// Memory of this process that is locked, kB; 0 if that cannot be read.
long locked_kB() { return std::strtol(driver::value_in("/proc/self/status", "VmLck:").c_str(), nullptr, 10); }

void touch(volatile unsigned char* memory, std::size_t bytes) {
  for (std::size_t at = 0; at < bytes; at += page_bytes) memory[at] = 0;
}

long faults() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt + usage.ru_majflt;
}

/// Touches the stack below this frame; returns the number of page faults.
[[gnu::noinline]] long touch_stack() {
  // Written by touch(). NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init)
  std::array<volatile unsigned char, stack_bytes> pages;
  const long before = faults();
  touch(pages.data(), pages.size());
  return faults() - before;
}

/// Touches a block of the heap and frees it; returns the number of page faults, -1 if there is no memory.
long touch_heap() {
  void* const block = std::malloc(heap_bytes);
  if (block == nullptr) return -1;
  const long before = faults();
  touch(static_cast<volatile unsigned char*>(block), heap_bytes);
  const long count = faults() - before;
  std::free(block);
  return count;
}

RealtimeStep judged(const char* what, long faults_when_repeated) {
  const bool obtained = faults_when_repeated == 0;
  return {.what = what,
          .obtained = obtained,
          .detail = faults_when_repeated < 0
                        ? "cannot allocate memory: the limit for locked memory (RLIMIT_MEMLOCK) is too low"
                        : std::to_string(faults_when_repeated) + " page faults when touched again",
          .fix = obtained ? "" : privilege_fix()};
}

/// The limit, divided by `unit`.
std::string limit_text(__rlimit_resource resource, rlim_t unit, const char* unit_text) {
  rlimit limit{};
  if (getrlimit(resource, &limit) != 0) return "unknown";
  return limit.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(limit.rlim_cur / unit) + unit_text;
}

/// Locks all memory of this process, present and future.
RealtimeStep lock_memory() {
  const int error = mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
  const long kB = locked_kB();
  const bool obtained = error == 0 && kB > 0;
  const std::string lacks = error != 0 ? std::strerror(error) : "the kernel shows no locked memory";
  return {.what = "memory locked (mlockall)",
          .obtained = obtained,
          .detail = obtained ? std::to_string(kB / 1024) + " MB locked"
                             : lacks + " (RLIMIT_MEMLOCK " + limit_text(RLIMIT_MEMLOCK, 1024, " kB") + ")",
          .fix = obtained ? "" : privilege_fix()};
}

/// Grows the heap once, touches it, and keeps it from shrinking.
RealtimeStep prefault_heap() {
  // One heap for all threads, no memory returned to the kernel, no block in a mapping of its own. Pages once touched
  // therefore stay in memory; mallopt(3). The heap has one lock for all threads: the cycle never allocates, whatever
  // the driver (the tests runtime_proofs and driver_proofs).
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  static_cast<void>(touch_heap());
  return judged("heap prefaulted, 4 MB", touch_heap());
}

/// Touches the part of the calling thread's stack that a cycle may use.
RealtimeStep prefault_stack() {
  static_cast<void>(touch_stack());
  return judged("stack prefaulted, 256 kB", touch_stack());
}

RealtimeStep schedule_fifo(int priority) {
  sched_param wanted{};
  wanted.sched_priority = priority;
  // pthread functions return their error and leave errno alone.
  const int set_error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &wanted);
  int policy = SCHED_OTHER;
  sched_param got{};
  const int get_error = pthread_getschedparam(pthread_self(), &policy, &got);
  const bool obtained = set_error == 0 && get_error == 0 && policy == SCHED_FIFO && got.sched_priority == priority;
  const std::string lacks = set_error != 0 ? std::strerror(set_error) : "the scheduler kept another policy";
  return {.what = "SCHED_FIFO priority " + std::to_string(priority),
          .obtained = obtained,
          .detail = obtained ? "read back from the scheduler"
                             : lacks + " (RLIMIT_RTPRIO " + limit_text(RLIMIT_RTPRIO, 1, "") + ")",
          .fix = obtained ? "" : fifo_fix(priority)};
}

RealtimeStep bind_to_cpu(int cpu) {
  cpu_set_t wanted;
  CPU_ZERO(&wanted);
  CPU_SET(static_cast<std::size_t>(cpu), &wanted);
  const int set_error = pthread_setaffinity_np(pthread_self(), sizeof wanted, &wanted);
  cpu_set_t got;
  CPU_ZERO(&got);
  const int get_error = pthread_getaffinity_np(pthread_self(), sizeof got, &got);
  const bool obtained = set_error == 0 && get_error == 0 && CPU_EQUAL(&wanted, &got);
  const char* const fix =
      "taskset -cp $$   # shows the CPUs that may be used; then --set realtime.cpu=N, or -1 for any";
  return {.what = "bound to CPU " + std::to_string(cpu),
          .obtained = obtained,
          .detail = obtained              ? "runs on CPU " + std::to_string(sched_getcpu())
                    : set_error == EINVAL ? "this CPU does not exist, or this process may not use it"
                                          : std::strerror(set_error != 0 ? set_error : get_error),
          .fix = obtained ? "" : fix};
}

RealtimeStep least_timer_slack() {
  constexpr unsigned long least_ns = 1;  // 0 would mean the default, 50 us
  const int error = prctl(PR_SET_TIMERSLACK, least_ns, 0, 0, 0) == 0 ? 0 : errno;
  const int got_ns = prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0);
  const bool obtained = error == 0 && got_ns >= 0 && got_ns <= static_cast<int>(least_ns);
  return {.what = "timer slack 1 ns",
          .obtained = obtained,
          .required = false,
          .detail = error == 0 ? "slack is " + std::to_string(got_ns) + " ns" : std::strerror(error),
          .fix = obtained ? "" : "no fix needed: timer slack does not apply under SCHED_FIFO"};
}

}  // namespace

Scheduling scheduling_of_this_thread() {
  int policy = SCHED_OTHER;
  sched_param parameters{};
  const bool known = pthread_getschedparam(pthread_self(), &policy, &parameters) == 0;
  // The flag means that children do not inherit the policy.
  constexpr int reset_on_fork = 0x40000000;
  const bool fifo = known && (policy & ~reset_on_fork) == SCHED_FIFO;
  return {.fifo_priority = fifo ? parameters.sched_priority : 0, .memory_locked = locked_kB() > 0};
}

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
  errno = 0;
  cpu_latency_file_ = ::open(device, O_RDWR | O_CLOEXEC);
  constexpr std::int32_t none_us = 0;
  std::int32_t got_us = -1;
  const bool written = cpu_latency_file_ >= 0 && ::write(cpu_latency_file_, &none_us, sizeof none_us) == sizeof none_us;
  const int error = errno;
  const bool obtained =
      written && ::pread(cpu_latency_file_, &got_us, sizeof got_us, 0) == sizeof got_us && got_us == 0;
  const std::string fix =
      error == ENOENT ? "no fix: this kernel has no CPU latency control (CONFIG_CPU_IDLE)" : cpu_latency_fix();
  report_.steps.push_back({.what = std::string(device) + " held at 0",
                           .obtained = obtained,
                           .required = false,
                           .detail = obtained  ? "the kernel's limit reads 0 us"
                                     : written ? "the kernel's limit is still " + std::to_string(got_us) + " us"
                                               : std::strerror(error),
                           .fix = obtained ? "" : fix});
}

}  // namespace abs_hil::runtime

#include "runtime/memory_locking.hpp"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "runtime/realtime_fixes.hpp"

namespace abs_hil::runtime {

namespace {

constexpr std::size_t heap_bytes = 4U << 20U;
constexpr std::size_t stack_bytes = 256U << 10U;
constexpr std::size_t page_bytes = 4096;

/// "VmLck" of /proc/self/status, kB; 0 if it cannot be read.
long locked_kB() {
  std::ifstream status("/proc/self/status");
  std::string field;
  while (status >> field) {
    long kB = 0;
    if (field == "VmLck:" && status >> kB) return kB;
  }
  return 0;
}

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

RealtimeStep judged(RealtimeStep step, long faults_when_repeated) {
  step.obtained = faults_when_repeated == 0;
  if (faults_when_repeated < 0) {
    step.detail = "cannot allocate memory: the limit for locked memory (RLIMIT_MEMLOCK) is too low";
    step.fix = privilege_fix();
  } else {
    step.detail = std::to_string(faults_when_repeated) + " page faults when touched again";
    if (!step.obtained) step.fix = privilege_fix();
  }
  return step;
}

}  // namespace

bool memory_is_locked() { return locked_kB() > 0; }

RealtimeStep lock_memory() {
  RealtimeStep step{.what = "memory locked (mlockall)"};
  const int result = mlockall(MCL_CURRENT | MCL_FUTURE);
  const int error = errno;
  const long kB = locked_kB();
  step.obtained = result == 0 && kB > 0;
  if (step.obtained) {
    step.detail = std::to_string(kB / 1024) + " MB locked";
  } else {
    rlimit limit{};
    getrlimit(RLIMIT_MEMLOCK, &limit);
    step.detail = result != 0 ? std::strerror(error) : "the kernel shows no locked memory";
    step.detail += " (RLIMIT_MEMLOCK " +
                   (limit.rlim_cur == RLIM_INFINITY ? "unlimited" : std::to_string(limit.rlim_cur / 1024) + " kB") +
                   ")";
    step.fix = privilege_fix();
  }
  return step;
}

RealtimeStep prefault_heap() {
  // One heap for all threads, no memory returned to the kernel, no block in a mapping of its own. Pages once touched
  // therefore stay in memory; mallopt(3). The heap has one lock for all threads: the cycle never allocates, whatever
  // the driver (the tests runtime_proofs and driver_proofs).
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  static_cast<void>(touch_heap());
  return judged({.what = "heap prefaulted, 4 MB"}, touch_heap());
}

RealtimeStep prefault_stack() {
  static_cast<void>(touch_stack());
  return judged({.what = "stack prefaulted, 256 kB"}, touch_stack());
}

}  // namespace abs_hil::runtime

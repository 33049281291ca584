// After the real-time set-up the cycle causes no page fault, from its first cycle on.

#include <sys/mman.h>
#include <sys/resource.h>

#include <thread>

#include "catch.hpp"
#include "cycle_run.hpp"
#include "runtime/realtime_setup.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

namespace {

constexpr std::size_t page_bytes = 4096;
volatile char* planted_page = nullptr;

long faults_of_this_thread() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_minflt + usage.ru_majflt;
}

/// Page faults of a whole run in a thread set up for real time. Where memory cannot be locked (no privileges) the first
/// 1,000 cycles bring their pages in.
long faults_of(const std::string& controller, PlantedLogic::Offence offence = nullptr) {
  VirtualClock clock;
  CycleRun run(clock, controller, 1000.0, 0.0, offence);
  long faults = -1;
  std::jthread([&] {
    const RealtimeScope realtime({});
    const bool locked = realtime.report().steps.front().obtained;
    for (int i = 0; !locked && i < 1'000; ++i) run.cycle();
    const long before = faults_of_this_thread();
    while (run.cycle()) {
    }
    faults = faults_of_this_thread() - before;
  }).join();
  REQUIRE(run.end_reason() == rig::Reason::sequence_complete);
  return faults;
}

}  // namespace

TEST_CASE("a whole experiment causes no page fault, with every controller") {
  for (const std::string& controller : all_controllers()) {
    CAPTURE(controller);
    CHECK(faults_of(controller) == 0);
  }
}

TEST_CASE("a planted page fault is found") {
  void* const page = mmap(nullptr, page_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  REQUIRE(page != MAP_FAILED);
  planted_page = static_cast<volatile char*>(page);
  // The offence comes after the warm-up of an unlocked run; the page is neither locked nor present.
  const auto touch_absent_page = [] {
    munlock(const_cast<char*>(planted_page), page_bytes);
    madvise(const_cast<char*>(planted_page), page_bytes, MADV_DONTNEED);
    *planted_page = 1;
  };
  static_assert(CycleRun::offence_cycle < 1'000);
  const bool can_lock = mlockall(MCL_CURRENT) == 0;
  munlockall();
  const long faults = faults_of("adaptive", touch_absent_page);
  CHECK(faults == (can_lock ? 1 : 0));
  munmap(page, page_bytes);
}

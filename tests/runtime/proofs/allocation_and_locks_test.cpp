// The cycle allocates nothing and takes no lock, with any controller, over a whole experiment.

#include <cstdlib>
#include <mutex>

#include "catch.hpp"
#include "cycle_run.hpp"
#include "interposed.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

namespace {

Offences offences_of(const std::string& controller, PlantedLogic::Offence offence = nullptr) {
  VirtualClock clock;
  CycleRun run(clock, controller, 1000.0, 0.0, offence);
  Offences found;
  {
    const OffenceCounter counter;
    while (run.cycle()) {
    }
    found = counter.so_far();
  }
  REQUIRE(run.end_reason() == rig::Reason::sequence_complete);
  REQUIRE(run.cycles() > 8'000);
  REQUIRE(run.beats() == run.cycles());
  return found;
}

std::mutex planted_mutex;

}  // namespace

TEST_CASE("a whole experiment allocates nothing and locks nothing, with every controller") {
  for (const std::string& controller : all_controllers()) {
    const Offences found = offences_of(controller);
    CAPTURE(controller);
    CHECK(found.allocations == 0);
    CHECK(found.locks == 0);
  }
}

TEST_CASE("a planted allocation is found: malloc, new and a growing container") {
  CHECK(offences_of("adaptive", [] {
          void* volatile block = malloc(8);  // volatile: not to be optimised away
          free(block);
        }).allocations == 2);
  CHECK(offences_of("adaptive", [] {
          auto* volatile number = new int(1);
          delete number;
        }).allocations == 2);
  CHECK(offences_of("adaptive", [] {
          std::vector<int> numbers(3);
          numbers.resize(100);
        }).allocations >= 2);
}

TEST_CASE("a planted lock is found") {
  CHECK(offences_of("adaptive", [] { const std::lock_guard held(planted_mutex); }).locks == 1);
}

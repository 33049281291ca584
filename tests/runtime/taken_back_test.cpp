// What the cycle sends after the guardian has taken the outputs back, and after a pause in the middle of a cycle.

#include <array>

#include "catch.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/heartbeat.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

TEST_CASE("a cycle that finds the guardian's mark sends the safe command and ends the run with its reason") {
  Bench bench;
  runtime::RunPage run;
  runtime::GuardPage guard;
  std::array<FlightSlot, 4> slots;
  FlightRing recorder(slots);
  runtime::Heartbeat heartbeat(run, guard, recorder);
  bench.executive.set_watch(heartbeat);
  bench.cycle();
  CHECK(bench.driver.written.back().brake_duty == 0.5);
  guard.taken_back_for.store(rig::Reason::machine_paused);
  CHECK_FALSE(bench.cycle());
  CHECK(rig::acts(bench.driver.written.back()) == false);
  CHECK(bench.logic.ended_by == rig::Reason::machine_paused);
}

TEST_CASE("after a pause of the whole computer the pause is the reason, not the mark that it led to") {
  Bench bench({.startup_cycles = 0, .max_consecutive = 0});
  runtime::RunPage run;
  runtime::GuardPage guard;
  std::array<FlightSlot, 4> slots;
  FlightRing recorder(slots);
  runtime::Heartbeat heartbeat(run, guard, recorder);
  bench.executive.set_watch(heartbeat);
  bench.cycle();
  bench.cycle();
  guard.taken_back_for.store(rig::Reason::guardian_paused);
  bench.cycle({.wakeup_ns = 600 * ms});
  CHECK(bench.logic.ended_by == rig::Reason::cycle_gap);
  CHECK_FALSE(rig::acts(bench.driver.written.back()));
}

TEST_CASE("a command that was computed before a pause is not sent after it") {
  for (const CycleScript& script : {CycleScript{.read_ns = 600 * ms}, CycleScript{.control_ns = 600 * ms}}) {
    Bench bench({.startup_cycles = 0, .max_consecutive = 0});
    bench.cycle();
    CHECK(rig::acts(bench.driver.written.back()));
    bench.cycle(script);
    CHECK_FALSE(rig::acts(bench.driver.written.back()));
    CHECK_FALSE(rig::acts(bench.logic.last));
    CHECK(bench.gate.fault() == rig::Reason::cycle_gap);
    CHECK_FALSE(bench.cycle());
    CHECK(bench.logic.ended_by == rig::Reason::cycle_gap);
  }
}

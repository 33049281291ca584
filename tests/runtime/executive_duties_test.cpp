// What the cycle owes its neighbours: gate, driver, logic, guardian and records learn what each needs, in every branch.
// scripts/mutate.py leaves each of these calls out.

#include <array>
#include <cmath>

#include "catch.hpp"
#include "gate/speed_windows.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/heartbeat.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

namespace {

/// A guardian's pages and the recorder of a run.
struct Watch {
  explicit Watch(std::uint64_t silent_cycles_max) : heartbeat(run, guard, recorder, silent_cycles_max) {}
  RunPage run;
  GuardPage guard;
  std::array<FlightSlot, 4> slots;
  FlightRing recorder{slots};
  Heartbeat heartbeat;
};

}  // namespace

TEST_CASE("a first tick in the past is kept, and not begun anew") {
  Bench bench;
  bench.executive.start_at(0);
  bench.cycle();
  CHECK(bench.clock.asked_ns.front() == 0);
}

TEST_CASE("a silent guardian ends the run, with the number of its silent cycles") {
  Bench bench;
  Watch watch(3);
  bench.executive.set_watch(watch.heartbeat);
  CHECK(bench.cycle());
  CHECK(bench.cycle());
  CHECK_FALSE(bench.cycle());
  CHECK(bench.gate.fault() == rig::Reason::guardian_silent);
  CHECK(bench.gate.fault_value() == 3.0);
  CHECK_FALSE(rig::acts(bench.driver.written.back()));
}

TEST_CASE("what the guardian takes the outputs back for has no value") {
  Bench bench;
  Watch watch(0);
  bench.executive.set_watch(watch.heartbeat);
  bench.cycle();
  watch.guard.taken_back_for.store(rig::Reason::guardian_paused);
  bench.cycle();
  CHECK(bench.gate.fault() == rig::Reason::guardian_paused);
  CHECK(bench.gate.fault_value() == 0.0);
}

TEST_CASE("the flight recorder gets every record") {
  Bench bench;
  Watch watch(0);
  bench.executive.set_watch(watch.heartbeat);
  bench.cycle();
  bench.cycle();
  REQUIRE(watch.recorder.contents().size() == 2);
  CHECK(watch.recorder.contents().back().sequence == 1);
}

TEST_CASE("a suspension between the first and the second cycle is found") {
  Bench bench;
  bench.cycle();
  bench.clock.suspension_ns += 2'000 * ms;
  bench.cycle();
  CHECK(bench.gate.fault() == rig::Reason::computer_suspended);
  CHECK(bench.gate.fault_value() == 2.0);
}

TEST_CASE("a long cycle that drives nothing is no fault, and its command is safe") {
  Bench bench;
  bench.logic.wanted = rig::safe_command;
  bench.cycle();
  bench.cycle({.control_ns = 600 * ms});
  CHECK(bench.gate.fault() == rig::Reason::none);
  CHECK_FALSE(rig::acts(bench.driver.written.back()));
}

TEST_CASE("a command that is as old as the longest gap is still sent") {
  Bench bench;  // the longest gap without a guardian is 100 ms
  bench.cycle();
  bench.cycle({.control_ns = 100 * ms});
  CHECK(rig::acts(bench.driver.written.back()));
  CHECK(bench.gate.fault() == rig::Reason::none);
}

TEST_CASE("the first error of the driver is kept") {
  Bench bench;
  bench.cycle();
  SECTION("of a read") {
    bench.driver.read_result = {driver::IoError::no_answer, 0x54};
    bench.cycle();
    bench.driver.read_result = {driver::IoError::disconnected, 0x60};
    bench.cycle();
  }
  SECTION("of a write, which makes the driver inactive: it says no more") {
    bench.driver.write_result = {driver::IoError::no_answer, 0x54};
    bench.cycle();
    bench.cycle();
  }
  CHECK(bench.executive.io_error().error == driver::IoError::no_answer);
  CHECK(bench.executive.io_error().where == 0x54U);
}

TEST_CASE("of another command that the board took, gate and logic hear before the cycle computes") {
  Bench bench;
  bench.cycle();
  CHECK(bench.logic.told.size() == 1);  // without one, only what was sent
  bench.driver.took = rig::Command{.brake_duty = 0.25};
  bench.cycle();
  REQUIRE(bench.logic.told.size() == 3);
  CHECK(bench.logic.told[1].brake_duty == 0.25);
  bench.driver.took = rig::Command{.brake_duty = 2.0};  // no board can: only the gate judges it
  CHECK_FALSE(bench.cycle());
  CHECK(bench.gate.fault() == rig::Reason::driver_write_failed);
  CHECK(bench.gate.fault_value() == 2.0);
}

TEST_CASE("the gate hears what the driver sent") {
  Bench bench;
  bench.driver.sends = rig::Command{.brake_duty = 1.5};
  bench.cycle();
  CHECK(bench.gate.fault() == rig::Reason::driver_write_failed);
  CHECK(bench.gate.fault_value() == 1.5);
}

TEST_CASE("a record has the measurement and the truth of its cycle, and the driver its phase") {
  Bench bench;
  bench.cycle();
  const rig::CycleRecord record = bench.record();
  CHECK(record.measurement.time_ns == 1'000 * ms);
  CHECK(record.truth.slip == 0.25);
  CHECK(bench.driver.phases == std::vector<rig::Phase>{rig::Phase::brake});
}

TEST_CASE("a measurement that must not be used stands in the record of the first cycle alone") {
  Bench bench;
  CommandGate gate({}, any_phase(), limits());
  CyclicExecutive executive(bench.clock, bench.driver, bench.logic, gate, bench.ring, ms,
                            {.startup_cycles = 0, .max_consecutive = 0});
  bench.driver.stamp_lag_ns = 5'000 * ms;  // stale
  executive.step();
  executive.step();
  const rig::CycleRecord first = bench.record();
  const rig::CycleRecord second = bench.record();
  CHECK_FALSE(first.sample_valid);
  CHECK(first.measurement.time_ns == -4'000 * ms);
  CHECK_FALSE(second.sample_valid);
  CHECK(second.measurement.time_ns == first.measurement.time_ns);
}

TEST_CASE("the gate hears that the wheels are apart, and compares them no more") {
  Bench bench;
  bench.logic.wanted = {};
  bench.logic.wheels_apart = GENERATE(false, true);
  CommandGate gate({}, any_phase(), limits());
  CyclicExecutive executive(bench.clock, bench.driver, bench.logic, gate, bench.ring, ms,
                            {.startup_cycles = 0, .max_consecutive = 0});
  bench.driver.counts_per_cycle = {0, 60};  // 92 rad/s of the lower wheel: rolling, the upper one would turn, too
  for (int i = 0; i < 300; ++i) executive.step();
  CHECK((gate.fault() == rig::Reason::none) == bench.logic.wheels_apart);
}

TEST_CASE("without statistics a cycle is late and in time as well") {
  Bench bench;
  CyclicExecutive executive(bench.clock, bench.driver, bench.logic, bench.gate, bench.ring, ms, {}, false);
  executive.step();
  bench.driver.script.read_ns = 3'400 * us;
  executive.step();
  bench.driver.script.read_ns = 0;
  executive.step();
  bench.record();
  bench.record();
  CHECK(bench.record().timing.periods_skipped == 3);
}

TEST_CASE("of parts that took equally long the first one is the cause, and a cycle in time has none") {
  Bench bench;
  bench.cycle({.read_ns = 600 * us, .control_ns = 600 * us});
  CHECK(bench.executive.statistics().overruns().of(rig::OverrunCause::read) == 1);
  bench.cycle();
  bench.cycle();
  bench.record();
  CHECK(bench.record().timing.overrun_cause == rig::OverrunCause::read);
  CHECK(bench.record().timing.overrun_cause == rig::OverrunCause::none);
}

TEST_CASE("two late cycles in a row that last as long as is allowed are a fault, one is not") {
  Bench bench({.startup_cycles = 0, .max_consecutive = 0, .late_max_s = 0.01});
  bench.cycle();
  bench.cycle({.control_ns = 20 * ms});
  CHECK(bench.gate.fault() == rig::Reason::none);
  bench.cycle();
  bench.cycle({.control_ns = 5 * ms});
  bench.cycle({.control_ns = 4 * ms});  // begins at 6 ms, ends at 10 ms
  CHECK(bench.gate.fault() == rig::Reason::consecutive_overruns);
  CHECK(bench.gate.fault_value() == 2.0);
}

// The cycle: its ticks, its times, its records, its end.
#include "runtime/cyclic_executive.hpp"

#include "catch.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

TEST_CASE("cycles start on absolute ticks, however long they take within the period") {
  Bench bench;
  for (int i = 0; i < 100; ++i) {
    REQUIRE(bench.cycle({.wakeup_ns = i % 7 * 10 * us, .read_ns = i % 5 * 50 * us, .control_ns = i % 3 * 100 * us}));
  }
  for (std::size_t i = 1; i < bench.clock.asked_ns.size(); ++i) {
    CHECK(bench.clock.asked_ns[i] - bench.clock.asked_ns[0] == static_cast<std::int64_t>(i) * ms);
  }
  CHECK(bench.executive.statistics().cycles() == 100);
  CHECK(bench.executive.statistics().overruns().total == 0);
}

TEST_CASE("the first tick may be set") {
  Bench bench;
  bench.executive.start_at(3'500 * ms);
  bench.cycle();
  bench.cycle();
  CHECK(bench.clock.asked_ns == std::vector<std::int64_t>{3'500 * ms, 3'501 * ms});
}

TEST_CASE("every part of a cycle is timed") {
  Bench bench;
  bench.cycle({.wakeup_ns = 11 * us, .read_ns = 22 * us, .control_ns = 33 * us, .write_ns = 44 * us});
  const rig::CycleTiming timing = bench.record().timing;
  CHECK(timing.wakeup_latency_ns == 11 * us);
  CHECK(timing.read_ns == 22 * us);
  CHECK(timing.control_ns == 33 * us);
  CHECK(timing.write_ns == 44 * us);
  CHECK(timing.cycle_ns == 99 * us);
  const rig::TimingSummary summary = bench.executive.statistics().summary();
  CHECK(summary.wakeup_latency.max_us == 11.0);
  CHECK(summary.read.max_us == 22.0);
  CHECK(summary.control.max_us == 33.0);
  CHECK(summary.write.max_us == 44.0);
  CHECK(summary.cycle_time.max_us == 99.0);
}

TEST_CASE("records carry the time since the start and consecutive numbers") {
  Bench bench;
  for (int i = 0; i < 3; ++i) bench.cycle();
  for (std::uint64_t i = 0; i < 3; ++i) {
    const rig::CycleRecord record = bench.record();
    CHECK(record.sequence == i);
    CHECK_THAT(record.time_s, Catch::Matchers::WithinAbs(1e-3 * static_cast<double>(i), 1e-12));
    CHECK(record.command.brake_duty == 0.5);
  }
}

TEST_CASE("a stop request ends the run at the next cycle with the safe command; the first reason stays") {
  Bench bench;
  REQUIRE(bench.cycle());
  bench.executive.request_stop(rig::Reason::interrupt_signal);
  bench.executive.request_stop(rig::Reason::stop_command);
  CHECK_FALSE(bench.cycle());
  CHECK(bench.logic.ended_by == rig::Reason::interrupt_signal);
  CHECK(bench.driver.written.back().brake_duty == 0.0);
}

TEST_CASE("a failed read latches a fault in the same cycle") {
  Bench bench;
  REQUIRE(bench.cycle());
  bench.driver.read_result = {driver::IoError::no_answer, 0x54};
  CHECK_FALSE(bench.cycle());
  CHECK(bench.gate.fault() == rig::Reason::driver_read_failed);
  CHECK(bench.driver.written.back().brake_duty == 0.0);
  CHECK(bench.executive.io_error().error == driver::IoError::no_answer);
  CHECK(bench.executive.io_error().where == 0x54U);
}

TEST_CASE("a backend's own reason replaces the general one") {
  Bench bench;
  REQUIRE(bench.cycle());
  SECTION("reading") { bench.driver.read_result = {driver::IoError::stalled, 0x84, 0, rig::Reason::usb_stalled}; }
  SECTION("writing") { bench.driver.write_result = {driver::IoError::stalled, 0x02, 0, rig::Reason::usb_stalled}; }
  while (bench.cycle()) {
  }
  CHECK(bench.gate.fault() == rig::Reason::usb_stalled);
  CHECK(bench.logic.ended_by == rig::Reason::usb_stalled);
}

TEST_CASE("a tripped interlock of the board latches a fault") {
  Bench bench;
  REQUIRE(bench.cycle());
  // Bit 1 is the supply; bits 0 and 2 are known only as a pair.
  const std::uint32_t flags = GENERATE(1U, 2U, 4U);
  bench.driver.trip_flags = flags;
  CHECK_FALSE(bench.cycle());
  CHECK(bench.gate.fault() == (flags == 2U ? rig::Reason::board_supply_tripped : rig::Reason::board_interlock_tripped));
  CHECK(bench.gate.fault_value() == static_cast<double>(flags));
}

TEST_CASE("a failed write latches a fault, makes the board safe and ends the run") {
  Bench bench;
  REQUIRE(bench.cycle());
  bench.driver.write_result = {driver::IoError::read_back_mismatch, 0x6C};
  REQUIRE(bench.cycle());  // the write comes last in this cycle, so the next cycle is the run's last
  CHECK(bench.driver.made_safe == 1);
  CHECK(bench.gate.fault() == rig::Reason::driver_write_failed);
  CHECK_FALSE(bench.cycle());
  CHECK(bench.logic.ended_by == rig::Reason::driver_write_failed);
}

TEST_CASE("record and logic get the command as the driver sent it, the safe one if it could not") {
  Bench bench;
  bench.driver.sends = rig::Command{.brake_duty = 0.4980392156862745};  // 127 of 255
  REQUIRE(bench.cycle());
  CHECK(bench.driver.written.back().brake_duty == 0.5);
  CHECK(bench.record().command.brake_duty == 0.4980392156862745);
  CHECK(bench.logic.last.brake_duty == 0.4980392156862745);
  bench.driver.write_result = {driver::IoError::no_answer, 0x54};
  REQUIRE(bench.cycle());
  CHECK(bench.record().command.brake_duty == 0.0);
  CHECK(bench.logic.last.brake_duty == 0.0);
}

TEST_CASE("a full ring drops records, counts them and delays nothing") {
  Bench bench({.startup_cycles = 0, .max_consecutive = 0}, 4);
  for (int i = 0; i < 10; ++i) REQUIRE(bench.cycle());
  CHECK(bench.ring.drops() == 6);
  CHECK(bench.record().sequence == 0);
  CHECK(bench.executive.statistics().cycles() == 10);
}

TEST_CASE("any rate from 100 Hz to 10 kHz keeps its period to the nanosecond") {
  for (const std::int64_t period_ns : {10 * ms, 5 * ms, ms, 200 * us, 100 * us}) {
    Bench bench;
    CyclicExecutive executive(bench.clock, bench.driver, bench.logic, bench.gate, bench.ring, period_ns);
    bench.clock.asked_ns.clear();
    for (int i = 0; i < 1000; ++i) executive.step();
    CHECK(bench.clock.asked_ns.back() - bench.clock.asked_ns.front() == 999 * period_ns);
  }
}

TEST_CASE("virtual time advances only by sleeping") {
  VirtualClock clock;
  clock.sleep_until(5 * ms);
  CHECK(clock.now_ns() == 5 * ms);
  clock.sleep_until(3 * ms);
  CHECK(clock.now_ns() == 5 * ms);
}

TEST_CASE("the monotonic clock never wakes early and returns at once for the past") {
  MonotonicClock clock;
  for (int i = 0; i < 20; ++i) {
    const std::int64_t until_ns = clock.now_ns() + 200 * us;
    clock.sleep_until(until_ns);
    CHECK(clock.now_ns() >= until_ns);
  }
  clock.sleep_until(0);
}

TEST_CASE("the logic learns in each cycle whether the checks of the wheels are free of doubt") {
  Bench bench;  // its gate does not check the wheels
  CHECK_FALSE(bench.logic.wheels_sound);
  bench.cycle();
  CHECK(bench.logic.wheels_sound);
}

TEST_CASE("a record tells whether its sample is of this cycle, and when the counters were read") {
  Bench bench;
  bench.driver.stamp_lag_ns = 250 * us;
  for (int n = 0; n < 3; ++n) REQUIRE(bench.cycle());
  for (int n = 0; n < 3; ++n) {
    const rig::CycleRecord record = bench.record();
    CHECK(record.sample_valid);
    CHECK_THAT(record.sample_time_s, Catch::Matchers::WithinAbs(1e-3 * n - 0.25e-3, 1e-12));
  }
  bench.driver.read_result = {driver::IoError::no_answer, 0x54};
  CHECK_FALSE(bench.cycle());
  const rig::CycleRecord failed = bench.record();
  CHECK_FALSE(failed.sample_valid);
  CHECK_THAT(failed.sample_time_s, Catch::Matchers::WithinAbs(2e-3 - 0.25e-3, 1e-12));  // that of the cycle before
}

TEST_CASE("the driver learns when the wheels part and join, once each") {
  Bench bench;
  REQUIRE(bench.cycle());
  bench.logic.wheels_apart = true;
  REQUIRE(bench.cycle());
  REQUIRE(bench.cycle());
  bench.logic.wheels_apart = false;
  REQUIRE(bench.cycle());
  REQUIRE(bench.cycle());
  CHECK(bench.driver.apart == std::vector<bool>{true, false});
  CHECK_FALSE(bench.record().wheels_apart);
  CHECK(bench.record().wheels_apart);
}

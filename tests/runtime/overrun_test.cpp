// Late cycles: whole periods are skipped, the phase stays, the part that took longest is named, too many are a fault.

#include <vector>

#include "catch.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/record_pump.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test;

TEST_CASE("a late cycle skips whole periods, keeps the phase and is not caught up with") {
  Bench bench;
  bench.cycle();
  bench.cycle({.read_ns = 3'400 * us});  // from tick 1 into the period of tick 4
  bench.cycle();
  bench.cycle();
  const std::vector<std::int64_t>& asked = bench.clock.asked_ns;
  CHECK(asked[2] - asked[0] == 5 * ms);
  CHECK(asked[3] - asked[0] == 6 * ms);
  const rig::OverrunCounts counts = bench.executive.statistics().overruns();
  CHECK(counts.total == 1);
  CHECK(counts.ticks_missed == 3);
  bench.record();
  CHECK(bench.record().timing.periods_skipped == 0);
  const rig::CycleRecord after = bench.record();
  CHECK(after.timing.periods_skipped == 3);
  CHECK(after.timing.overrun_cause == rig::OverrunCause::read);
  CHECK(bench.record().timing.periods_skipped == 0);
}

TEST_CASE("a cycle that ends exactly at the next tick is late, one that ends a nanosecond before is not") {
  Bench bench;
  bench.cycle({.control_ns = ms - 1});
  CHECK(bench.executive.statistics().overruns().total == 0);
  bench.cycle({.control_ns = ms});
  CHECK(bench.executive.statistics().overruns().total == 1);
  CHECK(bench.executive.statistics().overruns().ticks_missed == 1);
}

TEST_CASE("a late cycle is put down to the part that took longest") {
  struct Case {
    CycleScript script;
    rig::OverrunCause cause;
  };
  const std::vector<Case> cases{
      {{.wakeup_ns = 900 * us, .read_ns = 200 * us}, rig::OverrunCause::wakeup},
      {{.wakeup_ns = 100 * us, .read_ns = 950 * us}, rig::OverrunCause::read},
      {{.read_ns = 400 * us, .control_ns = 700 * us}, rig::OverrunCause::control},
      {{.control_ns = 300 * us, .write_ns = 800 * us}, rig::OverrunCause::write},
  };
  Bench bench;
  for (const Case& c : cases) {
    bench.cycle(c.script);
    CHECK(bench.executive.statistics().overruns().of(c.cause) == 1);
  }
  CHECK(bench.executive.statistics().overruns().total == cases.size());
}

namespace {
/// Time advances when the executive reads the clock after the write, as if the ring or the statistics were slow.
class SlowRecordingClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override {
    constexpr int asked_after_recording = 5;  // wake-up, read, control, write, then this
    if (sleeps == 2 && ++asked == asked_after_recording) time_ns += 1'500 * us;
    return time_ns;
  }
  void sleep_until(std::int64_t until_ns) noexcept override {
    ++sleeps;
    time_ns = std::max(time_ns, until_ns);
  }
  std::int64_t time_ns{0};
  int sleeps{0};
  int asked{0};
};
}  // namespace

TEST_CASE("slow recording is named too, in the record that follows") {
  Bench bench;
  SlowRecordingClock clock;
  CyclicExecutive executive(clock, bench.driver, bench.logic, bench.gate, bench.ring, ms,
                            {.startup_cycles = 0, .max_consecutive = 0});
  for (int i = 0; i < 3; ++i) executive.step();
  CHECK(executive.statistics().overruns().of(rig::OverrunCause::record) == 1);
  bench.record();
  bench.record();
  const rig::CycleRecord after = bench.record();
  CHECK(after.timing.record_ns == 1'500 * us);
  CHECK(after.timing.overrun_cause == rig::OverrunCause::record);
}

TEST_CASE("start-up cycles are neither counted as late nor measured") {
  Bench bench({.startup_cycles = 3, .max_consecutive = 1});
  for (int i = 0; i < 3; ++i) REQUIRE(bench.cycle({.read_ns = 5 * ms}));
  REQUIRE(bench.cycle({.read_ns = 10 * us}));
  const rig::OverrunCounts counts = bench.executive.statistics().overruns();
  CHECK(counts.total == 0);
  CHECK(counts.startup == 3);
  CHECK(bench.executive.statistics().parts()[1].count() == 1);
  CHECK(bench.executive.statistics().parts()[1].max_ns() == 10 * us);
  CHECK(bench.gate.fault() == rig::Reason::none);

  REQUIRE(bench.cycle({.read_ns = 5 * ms}));  // the fourth-but-one is not start-up any more
  CHECK(bench.executive.statistics().overruns().total == 1);
}

TEST_CASE("so many late cycles in a row latch a fault; one in time between them starts the count again") {
  Bench bench({.startup_cycles = 0, .max_consecutive = 3});
  const CycleScript late{.control_ns = 1'200 * us};
  REQUIRE(bench.cycle(late));
  REQUIRE(bench.cycle(late));
  REQUIRE(bench.cycle());
  REQUIRE(bench.cycle(late));
  REQUIRE(bench.cycle(late));
  CHECK(bench.gate.fault() == rig::Reason::none);
  REQUIRE(bench.cycle(late));
  CHECK(bench.gate.fault() == rig::Reason::consecutive_overruns);
  CHECK(bench.gate.fault_value() == 3.0);
  CHECK_FALSE(bench.cycle());
  CHECK(bench.logic.ended_by == rig::Reason::consecutive_overruns);
  CHECK(bench.driver.written.back().brake_duty == 0.0);
  CHECK(bench.executive.statistics().overruns().longest_run == 3);
}

TEST_CASE("late cycles end a run by their time, whatever their number") {
  // Each lasts 20 ms in cycles of 1 ms, so the next one begins after 21 ms: the eighth ends after 7 x 21 + 20 ms.
  const CycleScript late{.control_ns = 20 * ms};
  Bench bench({.startup_cycles = 0, .max_consecutive = 50, .late_max_s = 0.15});
  for (int i = 0; i < 7; ++i) REQUIRE(bench.cycle(late));
  REQUIRE(bench.cycle());  // in time: they count anew
  for (int i = 0; i < 7; ++i) REQUIRE(bench.cycle(late));
  CHECK(bench.gate.fault() == rig::Reason::none);
  REQUIRE(bench.cycle(late));
  CHECK(bench.gate.fault() == rig::Reason::consecutive_overruns);
  CHECK(bench.gate.fault_value() == 8.0);
  CHECK_FALSE(bench.cycle());
}

TEST_CASE("late cycles end a run by their time, too, if their number does not count") {
  Bench number({.startup_cycles = 0, .max_consecutive = 0, .late_max_s = 0.15});
  for (int i = 0; i < 8; ++i) REQUIRE(number.cycle({.control_ns = 20 * ms}));
  CHECK(number.gate.fault() == rig::Reason::consecutive_overruns);
}

TEST_CASE("one long cycle is a gap, not a row of late cycles") {
  Bench single({.startup_cycles = 0, .max_consecutive = 50, .late_max_s = 0.05});
  REQUIRE(single.cycle({.control_ns = 90 * ms}));
  CHECK(single.gate.fault() == rig::Reason::none);
}

TEST_CASE("with a limit of 0 and any time late cycles never end the run") {
  Bench bench({.startup_cycles = 0, .max_consecutive = 0, .late_max_s = 1000.0});
  for (int i = 0; i < 1000; ++i) REQUIRE(bench.cycle({.control_ns = 1'200 * us}));
  CHECK(bench.gate.fault() == rig::Reason::none);
  CHECK(bench.executive.statistics().overruns().longest_run == 1000);
}

TEST_CASE("late cycles give at most one message per second, with the parts of the latest one") {
  Bench bench;
  OverrunReporter reporter(ms);
  int messages = 0;
  std::string last;
  for (int i = 0; i < 2'500; ++i) {
    // Every second cycle is late, so that 2,500 cycles last 3.75 s.
    bench.cycle(i % 2 == 0 ? CycleScript{.wakeup_ns = 20 * us, .read_ns = 1'300 * us} : CycleScript{});
    reporter.consume(bench.record(), 0.0);
    if (const auto message = reporter.message(bench.executive.statistics().overruns())) {
      ++messages;
      last = *message;
    }
  }
  CHECK(messages == 4);
  CHECK(bench.executive.statistics().overruns().total == 1'250);
  CHECK(last.find("because of read: period 1000 us, woke 20 us late, read 1300") != std::string::npos);
  CHECK(std::stoul(last) >= 999);  // the message begins with the full count: a late cycle every 3 ms for 3 s
}

TEST_CASE("without late cycles there is no message") {
  Bench bench;
  OverrunReporter reporter(ms);
  for (int i = 0; i < 100; ++i) {
    bench.cycle();
    reporter.consume(bench.record(), 0.0);
    CHECK_FALSE(reporter.message(bench.executive.statistics().overruns()));
  }
}

namespace {

/// The reason that ends the bench's run after a gap of `gap_ns` between the wake-ups of two cycles.
rig::Reason reason_after_gap(std::int64_t gap_ns, const rig::Command& wanted, double limit_s = 0.0) {
  Bench bench({.startup_cycles = 0, .max_consecutive = 0, .cycle_gap_max_s = limit_s});
  bench.logic.wanted = wanted;
  bench.cycle();
  bench.cycle();
  bench.cycle({.wakeup_ns = gap_ns - ms});
  return bench.logic.ended_by;
}

}  // namespace

TEST_CASE("one long gap between two cycles with an output on is a fault, whatever part of the cycle it falls into") {
  for (const CycleScript& script : {CycleScript{.wakeup_ns = 600 * ms}, CycleScript{.read_ns = 600 * ms},
                                    CycleScript{.control_ns = 600 * ms}, CycleScript{.write_ns = 600 * ms}}) {
    Bench bench;
    bench.cycle();
    bench.cycle();
    bool goes_on = bench.cycle(script);
    int cycles = 1;
    for (; goes_on && cycles < 10; ++cycles) goes_on = bench.cycle();
    CHECK(cycles <= 2);
    CHECK(bench.logic.ended_by == rig::Reason::cycle_gap);
    CHECK(bench.logic.ended_value > 0.6);
    CHECK(bench.logic.ended_value < 0.602);
    CHECK(bench.driver.written.back().brake_duty == 0.0);
  }
}

TEST_CASE("a gap counts above its limit and with an output on only") {
  const rig::Command braking{.brake_duty = 0.5};
  CHECK(reason_after_gap(100 * ms, braking) == rig::Reason::none);
  CHECK(reason_after_gap(100 * ms + 1, braking) == rig::Reason::cycle_gap);
  CHECK(reason_after_gap(101 * ms, {.motor_duty = 0.5, .motor_enable = true}) == rig::Reason::cycle_gap);
  CHECK(reason_after_gap(101 * ms, {.brake_torque_Nm = 0.5}) == rig::Reason::cycle_gap);
  CHECK(reason_after_gap(10'000 * ms, {}) == rig::Reason::none);
  CHECK(reason_after_gap(20 * ms, braking, 0.02) == rig::Reason::none);
  CHECK(reason_after_gap(20 * ms + 1, braking, 0.02) == rig::Reason::cycle_gap);
  // Three periods are no gap.
  CHECK(reason_after_gap(3 * ms, braking, 0.001) == rig::Reason::none);
  CHECK(reason_after_gap(3 * ms + 1, braking, 0.001) == rig::Reason::cycle_gap);
}

TEST_CASE("a suspended computer is a fault with an output on, whatever the origin of its time") {
  for (const bool on : {true, false}) {
    Bench bench;
    bench.logic.wanted = on ? rig::Command{.brake_duty = 0.5} : rig::Command{};
    for (int i = 0; i < 3; ++i) bench.cycle();
    bench.clock.suspension_ns += ms;  // within the clocks' accuracy
    bench.cycle();
    bench.clock.suspension_ns -= 3 * ms;  // a delay between two clocks makes it smaller for one cycle
    bench.cycle();
    bench.clock.suspension_ns += 3 * ms;
    bench.cycle();
    CHECK(bench.logic.ended_by == rig::Reason::none);
    bench.clock.suspension_ns += 2'500 * ms;
    CHECK(bench.cycle() == !on);
    CHECK(bench.logic.ended_by == (on ? rig::Reason::computer_suspended : rig::Reason::none));
    if (on) CHECK(bench.logic.ended_value == Approx(2.5));
    if (on) CHECK(bench.driver.written.back().brake_duty == 0.0);
  }
}

TEST_CASE("a thread that is held up while it asks for the time before its first cycle finds no suspension") {
  Bench bench;
  bench.logic.wanted = {.brake_duty = 0.5};
  bench.clock.held_up_ns = {11 * ms, 40 * ms, 11 * ms};  // each of these readings is too small
  for (int i = 0; i < 5; ++i) bench.cycle();
  CHECK(bench.clock.held_up_ns.empty());
  CHECK(bench.logic.ended_by == rig::Reason::none);
}

// Events of a run, from its records.
#include "catch.hpp"
#include "telemetry/csv_sink.hpp"

namespace abs_hil::telemetry {
namespace {

using rig::Phase;
using rig::Reason;

rig::CycleRecord record(std::uint64_t sequence, Phase phase, Reason reason = Reason::none) {
  rig::CycleRecord r;
  r.sequence = sequence;
  r.phase = phase;
  r.reason = reason;
  return r;
}

TEST_CASE("the first record gives an event") {
  EventDetector detector;
  const auto event = detector.observe(record(0, Phase::accelerate, Reason::run_started));
  REQUIRE(event);
  CHECK(event->kind == event_kind::phase);
  CHECK(event->message == "accelerate: run started");
}

TEST_CASE("one event for each change of phase, with its reason") {
  EventDetector detector;
  (void)detector.observe(record(0, Phase::accelerate, Reason::run_started));
  CHECK_FALSE(detector.observe(record(1, Phase::accelerate)));
  const auto event = detector.observe(record(2, Phase::brake, Reason::speed_threshold_reached));
  REQUIRE(event);
  CHECK(event->kind == event_kind::phase);
  CHECK(event->message == "accelerate -> brake: upper wheel reached its speed threshold");
  CHECK_FALSE(detector.observe(record(3, Phase::brake)));
}

TEST_CASE("two consecutive phases of one kind give two events, whatever ended the first") {
  EventDetector detector;
  (void)detector.observe(record(0, Phase::brake, Reason::run_started));
  rig::CycleRecord next = record(1, Phase::brake, Reason::all_conditions_met);
  next.phase_index = 1;
  const auto event = detector.observe(next);
  REQUIRE(event);
  CHECK(event->kind == event_kind::phase);
  CHECK(event->message == "brake -> brake: all conditions that end the phase hold");
  CHECK_FALSE(detector.observe(next));
  next.phase_index = 2;
  CHECK(detector.observe(next)->kind == event_kind::phase);
}

TEST_CASE("a reason that stays on the records gives one event") {
  EventDetector detector;
  (void)detector.observe(record(0, Phase::brake, Reason::start_speed_given));
  CHECK_FALSE(detector.observe(record(1, Phase::brake, Reason::start_speed_given)));
}

TEST_CASE("a fault is an event of its own kind, once") {
  EventDetector detector;
  (void)detector.observe(record(0, Phase::brake));
  const auto event = detector.observe(record(1, Phase::fault, Reason::driver_read_failed));
  REQUIRE(event);
  CHECK(event->kind == event_kind::fault);
  CHECK(event->message == "brake -> fault: reading the board failed");
  CHECK_FALSE(detector.observe(record(2, Phase::fault, Reason::driver_read_failed)));
  CHECK_FALSE(detector.observe(record(3, Phase::fault)));
}

TEST_CASE("a fault's reason without the phase, and the phase without the reason, are faults too") {
  EventDetector detector;
  (void)detector.observe(record(0, Phase::brake));
  CHECK(detector.observe(record(1, Phase::stopped, Reason::phase_time_limit))->kind == event_kind::fault);
  CHECK(detector.observe(record(2, Phase::fault))->kind == event_kind::fault);
}

TEST_CASE("a refused command within a phase is a limit, once until it passes") {
  EventDetector detector;
  (void)detector.observe(record(0, Phase::brake));
  const auto event = detector.observe(record(1, Phase::brake, Reason::slip_control_left_at_low_speed));
  REQUIRE(event);
  CHECK(event->kind == event_kind::limit);
  CHECK_FALSE(detector.observe(record(2, Phase::brake, Reason::slip_control_left_at_low_speed)));
  CHECK_FALSE(detector.observe(record(3, Phase::brake)));
  CHECK(detector.observe(record(4, Phase::brake, Reason::slip_control_left_at_low_speed)));
}

TEST_CASE("a change is found once when the record that made it is missing") {
  EventDetector detector;
  (void)detector.observe(record(10, Phase::accelerate));
  const auto event = detector.observe(record(15, Phase::brake));
  REQUIRE(event);
  CHECK(event->message == "accelerate -> brake (4 records lost before)");
  CHECK_FALSE(detector.observe(record(16, Phase::brake)));
  CHECK_FALSE(detector.observe(record(30, Phase::brake)));  // a gap alone is no event
}

}  // namespace
TEST_CASE("events tell phases by the names that the experiment gives them") {
  EventDetector detector({.phases = {{rig::Phase::brake, "brake-low"}, {rig::Phase::brake, "brake-high"}}});
  rig::CycleRecord cycle;
  cycle.phase = rig::Phase::brake;
  CHECK(detector.observe(cycle)->message == "brake-low");
  cycle.sequence = 1;
  cycle.phase_index = 1;
  CHECK(detector.observe(cycle)->message == "brake-low -> brake-high");
  // A phase that the experiment does not plan has the name of its kind.
  cycle.sequence = 2;
  cycle.phase = rig::Phase::fault;
  cycle.reason = rig::Reason::overspeed;
  CHECK_THAT(detector.observe(cycle)->message, Catch::Matchers::StartsWith("brake-high -> fault: "));
}

}  // namespace abs_hil::telemetry

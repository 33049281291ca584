// Profiles over the time of a phase: steps, straight lines, ends.

#include <limits>
#include <stdexcept>

#include "catch.hpp"
#include "experiment/sequence.hpp"
#include "latched_sequence.hpp"

using namespace abs_hil::experiment;
using abs_hil::experiment::test::LatchedSequence;
using abs_hil::rig::Reason;

TEST_CASE("a profile is constant outside its points and straight or held between them") {
  const Profile line({{1.0, 10.0}, {3.0, 20.0}});
  CHECK(line.at(0.0) == 10.0);
  CHECK(line.at(2.0) == 15.0);
  CHECK(line.at(9.0) == 20.0);
  const Profile held({{1.0, 10.0}, {3.0, 20.0}}, Between::hold);
  CHECK(held.at(2.999) == 10.0);
  CHECK(held.at(3.0) == 20.0);
}

TEST_CASE("two points at one time are a step: the second holds from then on") {
  const Profile step({{0.0, 1.0}, {0.5, 1.0}, {0.5, 2.0}});
  CHECK(step.at(0.49999) == 1.0);
  CHECK(step.at(0.5) == 2.0);
  CHECK(Profile({{0.0, 1.0}, {0.0, 2.0}}).at(0.0) == 2.0);
}

TEST_CASE("a profile that goes back in time or is not finite is refused") {
  CHECK_THROWS_AS(Profile({{1.0, 0.0}, {0.5, 0.0}}), std::invalid_argument);
  CHECK_THROWS_AS(Profile({{0.0, std::numeric_limits<double>::quiet_NaN()}}), std::invalid_argument);
}

namespace {

Reason end_of(const EndCondition& condition, const SequenceInput& input, const SequenceLimits& limits = {}) {
  LatchedSequence sequence(
      {{.ends_on = {condition}, .time_limit_s = 100.0}, {.ends_on = {condition}, .time_limit_s = 100.0}}, limits);
  sequence.update({});
  SequenceInput before = input;  // speeds and slip count after two samples
  before.time_s -= 0.001;
  const Reason first = sequence.update(before).reason;
  return first != Reason::none ? first : sequence.update(input).reason;
}

}  // namespace

TEST_CASE("each condition ends its phase at its value and not before") {
  const auto ends = [](EndKind kind, double value, const SequenceInput& input) {
    return end_of({kind, value, Reason::stop_command}, input) == Reason::stop_command;
  };
  SequenceInput in{.time_s = 1.0, .speeds = {50.0, 60.0}, .car_speed_m_s = 6.0, .slip = 0.2, .distance_m = 4.0};
  CHECK(ends(EndKind::upper_speed_below, 50.1, in));
  CHECK_FALSE(ends(EndKind::upper_speed_below, 50.0, in));
  CHECK(ends(EndKind::lower_speed_above, 60.0, in));
  CHECK_FALSE(ends(EndKind::lower_speed_above, 60.1, in));
  CHECK(ends(EndKind::lower_speed_below, 60.1, in));
  CHECK_FALSE(ends(EndKind::lower_speed_below, 60.0, in));
  CHECK(ends(EndKind::car_speed_above, 6.0, in));
  CHECK_FALSE(ends(EndKind::car_speed_above, 6.1, in));
  CHECK(ends(EndKind::slip_above, 0.2, in));
  CHECK_FALSE(ends(EndKind::slip_above, 0.21, in));
  CHECK(ends(EndKind::slip_below, 0.21, in));
  CHECK_FALSE(ends(EndKind::slip_below, 0.2, in));
  CHECK(ends(EndKind::distance, 4.0, in));
  CHECK_FALSE(ends(EndKind::distance, 4.1, in));
}

TEST_CASE("all of several conditions must hold at the same time") {
  const EndCondition both{.kind = EndKind::all,
                          .reason = Reason::all_conditions_met,
                          .parts = {{EndKind::slip_above, 0.1}, {EndKind::lower_speed_below, 50.0}}};
  CHECK(end_of(both, {.time_s = 1.0, .speeds = {0.0, 40.0}, .slip = 0.2}) == Reason::all_conditions_met);
  CHECK(end_of(both, {.time_s = 1.0, .speeds = {0.0, 60.0}, .slip = 0.2}) == Reason::none);
  CHECK(end_of(both, {.time_s = 1.0, .speeds = {0.0, 40.0}, .slip = 0.0}) == Reason::none);
}

TEST_CASE("the distance of a phase counts from its beginning") {
  const EndCondition way{EndKind::distance, 2.0, Reason::distance_reached};
  LatchedSequence sequence({{.ends_on = {way}, .time_limit_s = 9.0}, {.ends_on = {way}, .time_limit_s = 9.0}});
  sequence.update({.distance_m = 1.0});
  CHECK_FALSE(sequence.update({.time_s = 0.1, .distance_m = 2.9}).entered);
  CHECK(sequence.update({.time_s = 0.2, .distance_m = 3.1}).reason == Reason::distance_reached);
  CHECK(sequence.index() == 1);
  CHECK_FALSE(sequence.update({.time_s = 0.3, .distance_m = 5.0}).entered);
  CHECK(sequence.phase_time_s() == Approx(0.1));
}

TEST_CASE("limits of the whole run are faults") {
  const EndCondition never{EndKind::standstill};
  CHECK(end_of(never, {.time_s = 5.1}, {.run_time_s = 5.0}) == Reason::run_time_limit);
  CHECK(end_of(never, {.time_s = 5.0}, {.run_time_s = 5.0}) == Reason::none);
  CHECK(end_of(never, {.time_s = 1.0, .distance_m = 7.1}, {.distance_m = 7.0}) == Reason::run_distance_limit);
  CHECK(abs_hil::rig::is_fault(Reason::run_distance_limit));
}

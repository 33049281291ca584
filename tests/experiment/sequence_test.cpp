// The sequence of phases: conditions, time limits, faults, and the latch.
#include "experiment/sequence.hpp"

#include <limits>
#include <stdexcept>
#include <utility>

#include "catch.hpp"
#include "latched_sequence.hpp"

using namespace abs_hil::experiment;
using abs_hil::experiment::test::LatchedSequence;
using abs_hil::rig::Phase;
using abs_hil::rig::Reason;

namespace {

LatchedSequence two_phases(EndCondition first_end) {
  return LatchedSequence({{.phase = Phase::accelerate, .motor_duty = 0.8, .ends_on = {first_end}, .time_limit_s = 5.0},
                          {.phase = Phase::brake,
                           .brake = BrakeAction::slip_control,
                           .ends_on = {{EndKind::duration, 1.0, Reason::phase_duration_over}},
                           .time_limit_s = 2.0}});
}

SequenceInput at(double time_s, double omega1_rad_s = 0.0) {
  return {.time_s = time_s, .speeds = {omega1_rad_s, omega1_rad_s}, .car_speed_m_s = 0.099 * omega1_rad_s};
}

}  // namespace

TEST_CASE("an unsafe phase is refused by name") {
  const PhasePlan sound{.phase = Phase::hold,
                        .motor_duty = 0.3,
                        .ends_on = {{EndKind::duration, 1.0, Reason::phase_duration_over}},
                        .time_limit_s = 600.0};
  CHECK_NOTHROW(LatchedSequence({sound}));
  const auto refused = [&](auto&& change, const char* what) {
    PhasePlan plan = sound;
    change(plan);
    CHECK_THROWS_WITH(LatchedSequence({plan}), Catch::Matchers::Contains("hold") && Catch::Matchers::Contains(what));
  };
  constexpr double infinite = std::numeric_limits<double>::infinity();
  refused([](PhasePlan& p) { p.time_limit_s = infinite; }, "time limit inf");
  refused([](PhasePlan& p) { p.time_limit_s = 600.1; }, "(0, 600]");
  refused([](PhasePlan& p) { p.time_limit_s = 0.0; }, "time limit");
  refused([](PhasePlan& p) { p.motor_duty = 1.01; }, "[0, 1]");
  refused([](PhasePlan& p) { p.motor_duty = -0.01; }, "[0, 1]");
  refused([](PhasePlan& p) { p.motor_duty = std::numeric_limits<double>::quiet_NaN(); }, "[0, 1]");
  refused([](PhasePlan& p) { p.brake_torque_Nm = infinite; }, "brake torque inf");
  refused([](PhasePlan& p) { p.brake_torque_Nm = -1.0; }, "brake torque");
  refused([](PhasePlan& p) { p.brake = BrakeAction::slip_control; }, "motor_with_brake");
  refused(
      [](PhasePlan& p) {
        p.brake = BrakeAction::torque;
        p.brake_torque_Nm = 1.0;
      },
      "motor_with_brake");
  PhasePlan meant = sound;
  meant.brake = BrakeAction::slip_control;
  meant.motor_with_brake = true;
  CHECK_NOTHROW(LatchedSequence({meant}));
}

TEST_CASE("phases follow one another in the cycle in which a condition holds for the second time") {
  LatchedSequence sequence = two_phases({EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached});
  const auto first = sequence.update(at(0.0));
  CHECK(first.entered);
  CHECK(first.reason == Reason::run_started);
  CHECK(sequence.current().motor_duty.at(0.0) == 0.8);
  CHECK_FALSE(sequence.update(at(1.0, 99.9)).entered);
  CHECK_FALSE(sequence.update(at(1.1, 100.0)).entered);
  const auto second = sequence.update(at(1.101, 100.0));
  CHECK(second.entered);
  CHECK(second.reason == Reason::speed_threshold_reached);
  CHECK(sequence.current().phase == Phase::brake);
  CHECK(sequence.current().motor_duty.at(0.0) == 0.0);
  CHECK_FALSE(sequence.finished());
  const auto end = sequence.update(at(2.2));
  CHECK(end.reason == Reason::sequence_complete);
  CHECK(sequence.finished());
  CHECK(sequence.current().phase == Phase::stopped);
  CHECK(sequence.current().brake == BrakeAction::released);
}

TEST_CASE("exceeding a time limit is a fault with the phase's duration as value") {
  LatchedSequence sequence = two_phases({EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached});
  sequence.update(at(0.0));
  CHECK_FALSE(sequence.update(at(5.0, 50.0)).entered);
  const auto end = sequence.update(at(5.01, 50.0));
  CHECK(end.reason == Reason::phase_time_limit);
  CHECK_THAT(end.value, Catch::Matchers::WithinAbs(5.01, 1e-12));
  CHECK(sequence.current().phase == Phase::fault);
  CHECK(sequence.current().motor_duty.at(0.0) == 0.0);
  CHECK(sequence.finished());
}

TEST_CASE("a peak is a maximum that was not exceeded for a while; standstill before the start is not a peak") {
  LatchedSequence sequence = two_phases({EndKind::upper_wheel_peak, 0.3, Reason::upper_wheel_peak_detected});
  sequence.update(at(0.0));
  CHECK_FALSE(sequence.update(at(0.5)).entered);
  double time_s = 0.5;
  for (double speed = 1.0; speed <= 150.0; speed += 1.0)
    CHECK_FALSE(sequence.update(at(time_s += 0.01, speed)).entered);
  CHECK_FALSE(sequence.update(at(time_s + 0.29, 150.05)).entered);
  CHECK(sequence.update(at(time_s + 0.301, 149.9)).reason == Reason::upper_wheel_peak_detected);
}

TEST_CASE("car speed and standstill end phases") {
  LatchedSequence slow = two_phases({EndKind::car_speed_below, 0.3, Reason::end_speed_reached});
  slow.update(at(0.0, 50.0));
  CHECK_FALSE(slow.update(at(0.1, 0.3 / 0.099 + 0.01)).entered);
  CHECK_FALSE(slow.update(at(0.2, 0.3 / 0.099 - 0.01)).entered);
  CHECK(slow.update(at(0.21, 0.3 / 0.099 - 0.01)).reason == Reason::end_speed_reached);

  LatchedSequence still = two_phases({EndKind::standstill, 0.0, Reason::standstill_reached});
  still.update(at(0.0));
  CHECK_FALSE(still.update(at(0.1)).entered);
  SequenceInput standing = at(0.2);
  standing.stands_still = true;
  CHECK(still.update(standing).reason == Reason::standstill_reached);
}

TEST_CASE(
    "an early end: a stop request leads to stopped, a fault to fault; the first of each stays, a fault counts more") {
  struct Case {
    Reason first, second, ends_by;
    double value;
    Phase phase;
  };
  for (const auto& [first, second, ends_by, value, phase] :
       {Case{Reason::interrupt_signal, Reason::stop_command, Reason::interrupt_signal, 0.0, Phase::stopped},
        Case{Reason::overspeed, Reason::driver_read_failed, Reason::overspeed, 7.0, Phase::fault},
        Case{Reason::overspeed, Reason::interrupt_signal, Reason::overspeed, 7.0, Phase::fault},
        Case{Reason::interrupt_signal, Reason::driver_read_failed, Reason::driver_read_failed, 8.0, Phase::fault}}) {
    LatchedSequence sequence = two_phases({EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached});
    sequence.update(at(0.0));
    sequence.latch.latch(first, 7.0);
    sequence.latch.latch(second, 8.0);
    const auto end = sequence.update(at(0.1, 200.0));
    CHECK(end.reason == ends_by);
    CHECK(end.value == value);
    CHECK(sequence.current().phase == phase);
    CHECK(sequence.current().motor_duty.at(0.0) == 0.0);
    CHECK(sequence.finished());
  }
}

TEST_CASE(
    "a stop request may first brake with the motor off until standstill or its limit; a fault ends that at once") {
  const auto stopping = [](StopBrake brake, Reason reason) {
    LatchedSequence sequence({{.phase = Phase::accelerate,
                               .motor_duty = 0.8,
                               .ends_on = {{EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached}},
                               .time_limit_s = 5.0}},
                             {}, brake);
    CHECK(sequence.permissions()[static_cast<std::size_t>(Phase::hold)].brake == (brake.duty > 0.0));
    sequence.update(at(0.0));
    sequence.latch.latch(reason, 0.0);
    return sequence;
  };
  SequenceInput standing = at(1.5);
  standing.stands_still = true;
  {
    LatchedSequence sequence = stopping({.duty = 0.6, .limit_s = 2.0}, Reason::interrupt_signal);
    const Sequence::Change begun = sequence.update(at(1.0, 50.0));
    CHECK(begun.entered);
    CHECK(begun.reason == Reason::interrupt_signal);
    CHECK(sequence.current().phase == Phase::hold);
    CHECK(sequence.current().motor_duty.at(0.0) == 0.0);
    CHECK(sequence.current().brake_duty.at(0.0) == 0.6);
    sequence.latch.latch(Reason::terminate_signal, 0.0);  // a repeated request
    CHECK_FALSE(sequence.update(at(2.9, 50.0)).entered);
    CHECK_FALSE(sequence.finished());
    CHECK(sequence.update(at(3.0, 50.0)).reason == Reason::interrupt_signal);  // its 2 s are over
    CHECK(sequence.finished());
    CHECK(sequence.current().brake == BrakeAction::released);
    CHECK(sequence.current().phase == Phase::stopped);
  }
  {
    LatchedSequence sequence = stopping({.duty = 0.6}, Reason::stop_command);
    sequence.update(at(1.0, 50.0));
    CHECK(sequence.update(standing).reason == Reason::stop_command);
    CHECK(sequence.finished());
  }
  {
    LatchedSequence sequence = stopping({.duty = 0.6}, Reason::hangup_signal);
    sequence.update(at(1.0, 50.0));
    sequence.latch.latch(Reason::driver_read_failed, 8.0);
    sequence.latch.latch(Reason::driver_write_failed, 9.0);
    const Sequence::Change end = sequence.update(at(1.001, 50.0));
    CHECK(end.reason == Reason::driver_read_failed);
    CHECK(end.value == 8.0);
    CHECK(sequence.current().phase == Phase::fault);
    CHECK(sequence.current().brake == BrakeAction::released);
  }
  {
    LatchedSequence sequence = stopping({.duty = 0.6}, Reason::interrupt_signal);
    sequence.update(standing);  // both wheels stand
    CHECK(sequence.finished());
  }
  for (const auto& [brake, reason] :
       {std::pair(StopBrake{}, Reason::interrupt_signal), std::pair(StopBrake{.duty = 0.6}, Reason::guardian_died)}) {
    LatchedSequence sequence = stopping(brake, reason);
    sequence.update(at(1.0, 50.0));
    CHECK(sequence.finished());
  }
  CHECK_THROWS_WITH(stopping({.duty = 1.2}, Reason::none),
                    Catch::Matchers::Contains("after a stop request: brake duty"));
  CHECK_THROWS_AS(stopping({.duty = 0.6, .limit_s = 0.0}, Reason::none), std::invalid_argument);
}

TEST_CASE("one sample of speed or slip ends no phase, nor does the same sample twice") {
  struct Row {
    EndKind kind;
    double value;
    SequenceInput outside, inside;
  };
  const SequenceInput slow{.speeds = {50.0, 50.0}, .car_speed_m_s = 5.0, .slip = 0.1};
  const SequenceInput fast{.speeds = {150.0, 150.0}, .car_speed_m_s = 15.0, .slip = 0.5};
  for (const Row& row : {Row{EndKind::upper_speed_above, 100.0, slow, fast},
                         {EndKind::upper_speed_below, 100.0, fast, slow},
                         {EndKind::lower_speed_above, 100.0, slow, fast},
                         {EndKind::lower_speed_below, 100.0, fast, slow},
                         {EndKind::car_speed_above, 10.0, slow, fast},
                         {EndKind::car_speed_below, 10.0, fast, slow},
                         {EndKind::slip_above, 0.3, slow, fast},
                         {EndKind::slip_below, 0.3, fast, slow}}) {
    for (const bool part_of_all : {false, true}) {
      const EndCondition alone{row.kind, row.value, Reason::speed_condition_met};
      const EndCondition all{EndKind::all, 0.0, Reason::all_conditions_met, {{EndKind::duration, 0.0}, alone}};
      LatchedSequence sequence = two_phases(part_of_all ? all : alone);
      const auto entered_at = [&](double time_s, SequenceInput input) {
        input.time_s = time_s;
        return sequence.update(input).entered;
      };
      CHECK(entered_at(0.0, row.outside));
      CHECK_FALSE(entered_at(0.001, row.inside));
      CHECK_FALSE(entered_at(0.002, row.outside));
      CHECK_FALSE(entered_at(0.003, row.inside));
      CHECK_FALSE(entered_at(0.003, row.inside));  // no fresh measurement came
      CHECK_FALSE(entered_at(0.004, row.outside));
      CHECK_FALSE(entered_at(0.005, row.inside));
      CHECK_FALSE(entered_at(0.005, row.outside));
      CHECK(entered_at(0.006, row.inside));
    }
  }
}

TEST_CASE("a sample that held in one phase does not count in the next") {
  const EndCondition fast{EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached};
  LatchedSequence sequence({{.phase = Phase::accelerate, .motor_duty = 0.8, .ends_on = {fast}, .time_limit_s = 5.0},
                            {.phase = Phase::coast, .ends_on = {fast}, .time_limit_s = 5.0},
                            {.phase = Phase::hold, .ends_on = {fast}, .time_limit_s = 5.0}});
  sequence.update(at(0.0, 150.0));
  CHECK_FALSE(sequence.update(at(0.001, 150.0)).entered);
  CHECK(sequence.update(at(0.002, 150.0)).entered);
  CHECK_FALSE(sequence.update(at(0.003, 150.0)).entered);
  CHECK(sequence.update(at(0.004, 150.0)).entered);
}

TEST_CASE("after a fault that permits it the brake holds until standstill or its limit") {
  const auto failing = [](StopBrake brake, Reason reason) {
    LatchedSequence sequence({{.phase = Phase::accelerate,
                               .motor_duty = 0.8,
                               .ends_on = {{EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached}},
                               .time_limit_s = 5.0}},
                             {}, {}, brake);
    CHECK(sequence.permissions()[static_cast<std::size_t>(Phase::fault)].brake == (brake.duty > 0.0));
    sequence.update(at(0.0));
    sequence.latch.latch(reason, 7.0);
    return sequence;
  };
  {
    LatchedSequence sequence = failing({.duty = 0.4, .limit_s = 2.0}, Reason::encoder_upper_stuck);
    const Sequence::Change begun = sequence.update(at(1.0, 50.0));
    CHECK(begun.reason == Reason::encoder_upper_stuck);
    CHECK(begun.value == 7.0);
    CHECK(sequence.current().phase == Phase::fault);
    CHECK(sequence.current().brake_duty.at(0.0) == 0.4);
    CHECK(sequence.current().motor_duty.at(0.0) == 0.0);
    CHECK_FALSE(sequence.finished());
    sequence.latch.latch(Reason::encoder_upper_stuck, 7.0);  // told in each cycle
    sequence.latch.latch(Reason::interrupt_signal, 0.0);
    CHECK_FALSE(sequence.update(at(2.9, 50.0)).entered);
    CHECK(sequence.update(at(3.0, 50.0)).reason == Reason::encoder_upper_stuck);
    CHECK(sequence.finished());
    CHECK(sequence.current().brake == BrakeAction::released);
  }
  {
    LatchedSequence sequence = failing({.duty = 0.4, .limit_s = 2.0}, Reason::overspeed);
    sequence.update(at(1.0, 50.0));
    SequenceInput standing = at(1.5);
    standing.stands_still = true;
    CHECK(sequence.update(standing).reason == Reason::overspeed);
    CHECK(sequence.finished());
  }
  {
    LatchedSequence sequence = failing({.duty = 0.4, .limit_s = 2.0}, Reason::overspeed);
    sequence.update(at(1.0, 50.0));
    sequence.latch.latch(Reason::driver_write_failed, 3.0);  // a second fault bars the brake
    CHECK(sequence.update(at(1.001, 50.0)).reason == Reason::overspeed);
    CHECK(sequence.finished());
  }
  for (const auto& [brake, reason] :
       {std::pair(StopBrake{}, Reason::overspeed), std::pair(StopBrake{.duty = 0.4}, Reason::driver_write_failed),
        std::pair(StopBrake{.duty = 0.4}, Reason::brake_no_response),
        std::pair(StopBrake{.duty = 0.4}, Reason::guardian_died)}) {
    LatchedSequence sequence = failing(brake, reason);
    CHECK(sequence.update(at(1.0, 50.0)).reason == reason);
    CHECK(sequence.finished());
  }
  // The sequence's own faults are treated alike.
  LatchedSequence late = failing({.duty = 0.4, .limit_s = 2.0}, Reason::none);
  CHECK(late.update(at(5.1, 50.0)).reason == Reason::phase_time_limit);
  CHECK_FALSE(late.finished());
  CHECK(late.current().phase == Phase::fault);
  CHECK(late.current().brake_duty.at(0.0) == 0.4);
  CHECK_THROWS_WITH(failing({.duty = 1.2}, Reason::none), Catch::Matchers::Contains("after a fault: brake duty"));
}

TEST_CASE("plans that could never end are refused") {
  CHECK_THROWS_AS(LatchedSequence(std::vector<PhasePlan>{}), std::invalid_argument);
  CHECK_THROWS_AS(LatchedSequence({{.phase = Phase::idle, .time_limit_s = 1.0}}), std::invalid_argument);
  CHECK_THROWS_AS(LatchedSequence({{.phase = Phase::idle, .ends_on = {{EndKind::duration, 1.0, Reason::none}}}}),
                  std::invalid_argument);
}

TEST_CASE("a run is not complete while the checks of the wheels doubt the speeds") {
  LatchedSequence sequence = two_phases({EndKind::upper_speed_above, 100.0, Reason::speed_threshold_reached});
  const auto doubted = [](double time_s, double omega1_rad_s = 0.0) {
    SequenceInput input = at(time_s, omega1_rad_s);
    input.wheels_sound = false;
    return input;
  };
  static_cast<void>(sequence.update(doubted(0.0)));
  static_cast<void>(sequence.update(doubted(0.1, 100.0)));
  CHECK(sequence.update(doubted(0.2, 100.0)).entered);  // other phases end
  CHECK_FALSE(sequence.update(doubted(1.3)).entered);
  CHECK_FALSE(sequence.update(doubted(1.5)).entered);
  LatchedSequence doubted_for_long = sequence;
  CHECK(sequence.update(at(1.6)).reason == Reason::sequence_complete);
  CHECK(sequence.finished());
  CHECK(doubted_for_long.update(doubted(2.3)).reason == Reason::phase_time_limit);
}

TEST_CASE("a phase that asks ends when the question is answered, and in time") {
  const PhasePlan asks{.phase = Phase::coast,
                       .ends_on = {{EndKind::answer, 0.0, Reason::question_answered}},
                       .time_limit_s = 5.0,
                       .wheels_apart = true,
                       .question = "Lift the wheel."};
  const PhasePlan after{
      .phase = Phase::hold, .ends_on = {{EndKind::duration, 1.0, Reason::phase_duration_over}}, .time_limit_s = 2.0};
  LatchedSequence answered({asks, after});
  CHECK_FALSE(answered.wheels_apart());
  CHECK(answered.update(at(0.0)).entered);
  CHECK(answered.wheels_apart());
  CHECK_FALSE(answered.update(at(4.9)).entered);
  SequenceInput now = at(5.0);
  now.answered = true;
  const Sequence::Change change = answered.update(now);
  CHECK(change.entered);
  CHECK(change.reason == Reason::question_answered);
  CHECK(answered.index() == 1);
  CHECK_FALSE(answered.wheels_apart());

  LatchedSequence alone({asks, after}, {}, {}, {.duty = 0.5});
  static_cast<void>(alone.update(at(0.0, 50.0)));
  const Sequence::Change late = alone.update(at(5.1, 50.0));
  CHECK(late.reason == Reason::question_unanswered);
  CHECK(alone.finished());  // the brake does not hold: somebody may have a hand at the wheel
  CHECK(alone.wheels_apart());

  for (const bool motor : {true, false}) {
    PhasePlan acts = asks;
    if (motor) acts.motor_duty = 0.1;
    if (!motor) acts.brake = BrakeAction::duty;
    CHECK_THROWS_WITH(LatchedSequence({acts}), Catch::Matchers::Contains("asks a person"));
  }
}

// The steps of commissioning on a good rig, their order, their guard, and what a person answers.

#include <algorithm>
#include <cstdint>
#include <stdexcept>

#include "commissioning_labs.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;
using Catch::Matchers::Contains;
using experiment::CommissioningResult;

TEST_CASE("A good rig passes all four steps, each asked for, and is safe after") {
  Lab lab;
  CHECK(lab.run() == CommissioningResult::passed);
  INFO(lab.person.said);
  CHECK(lab.person.asked.size() == 5);
  CHECK_THAT(lab.person.asked.back(), Contains("see or hear the brake"));
  CHECK_THAT(lab.person.said, Contains("ok: 4096 counts forward, 1.000 turns at 4096 counts a turn"));
  CHECK(lab.card.model.outputs().brake_duty == 0.0);
  CHECK(lab.driver.state() == driver::DriverState::inactive);
  CHECK(largest_width(lab.card) <= 0.5 + 1.0 / 4095.0);  // the brake's pulse is the largest
}

TEST_CASE("Each pulse has its guard from before it until the outputs are 0 again") {
  Lab lab;
  CHECK(lab.run() == CommissioningResult::passed);
  CHECK(lab.guard.begun == 4);
  CHECK(lab.guard.ended_safe == 4);
  CHECK(lab.guard.beats >= 600);  // once a millisecond

  Lab dying;
  dying.guard.dies_at = 50;
  CHECK(dying.run() == CommissioningResult::failed);
  CHECK_THAT(dying.person.said, Contains("the guardian process has ended"));
  CHECK(dying.guard.beats == 50);
  CHECK(dying.guard.ended_safe == 2);
  CHECK(dying.card.model.outputs().drive_duty == 0.0);

  Lab alone;
  alone.guard.refuses = true;
  CHECK_THROWS_AS(alone.run(), driver::Unavailable);
  CHECK(largest_width(alone.card) == 0.0);
}

TEST_CASE("The last step measures what the board does by itself, and how soon it is safe") {
  Lab holds;
  CHECK(holds.run() == CommissioningResult::passed);
  CHECK_THAT(holds.person.said, Contains("the board HOLDS its outputs"));
  CHECK_THAT(holds.person.said, Contains("the safe state was verified"));

  // A board whose outputs are on while somebody commands them, and for 40 ms after.
  OtherLab lab;
  bool on = false;
  std::int64_t commanded_ns = 0;
  const auto on_write = lab.board.on_write;
  lab.board.on_write = [&](const rig::Command& command) {
    on = command.brake_duty > 0.0;
    commanded_ns = lab.clock.now_ns();
    return on_write(command);
  };
  lab.board.on_outputs = [&](rig::Command& applied) {
    applied.brake_duty = on && lab.clock.now_ns() - commanded_ns < 40'000'000 ? 0.5 : 0.0;
    return true;
  };
  const ModelCard none;
  Guard guard(none);
  experiment::Commissioning commissioning(lab.board, lab.clock, lab.person, guard, {}, [] { return false; });
  CHECK(commissioning.run() == CommissioningResult::passed);
  REQUIRE(commissioning.output_times().watchdog_ms);
  CHECK(*commissioning.output_times().watchdog_ms >= 39.0);
  CHECK(*commissioning.output_times().watchdog_ms <= 41.0);
  CHECK(commissioning.output_times().release_ms.has_value());

  OtherLab mute;
  CHECK(mute.run() == CommissioningResult::passed);
  CHECK_THAT(mute.person.said, Contains("does not report its outputs"));
}

TEST_CASE("The answer no ends the commissioning: nothing is written before step 2, only zeros before step 3") {
  for (int step = 1; step <= 4; ++step) {
    Lab lab;
    lab.person.no_to = step;
    CHECK(lab.run() == CommissioningResult::declined);
    CHECK(static_cast<int>(lab.person.asked.size()) == step);
    CHECK(lab.guard.taken == (step > 1 ? 1 : 0));  // a service's lease, before the board is opened
    const bool wrote =
        std::any_of(lab.card.traffic.begin(), lab.card.traffic.end(), [](auto& a) { return a.is_write; });
    CHECK(wrote == (step > 2));
    CHECK((largest_width(lab.card) > 0.0) == (step > 3));
  }
}

TEST_CASE("A tripped interlock and a request to stop end a pulse at once") {
  Lab lab;
  std::int64_t asked_ns = 0;
  SECTION("trip") {
    lab.person.before_answer = [&] {
      asked_ns = lab.clock.now_ns();
      if (lab.person.asked.size() == 3) lab.card.model.set_supply_V(5.0);
    };
    CHECK(lab.run() == CommissioningResult::failed);
    CHECK_THAT(lab.person.said, Contains("interlocks have tripped"));
  }
  SECTION("stop") {
    lab.person.before_answer = [&] {
      asked_ns = lab.clock.now_ns();
      lab.stop = lab.person.asked.size() == 3;
    };
    CHECK(lab.run() == CommissioningResult::interrupted);
  }
  CHECK(lab.card.model.outputs().drive_duty == 0.0);
  CHECK(lab.clock.now_ns() < asked_ns + 100'000'000);
}

TEST_CASE("Pulses that could run away are refused") {
  Lab lab;
  CHECK_THROWS_AS(experiment::Commissioning(lab.driver, lab.clock, lab.person, lab.guard, {.drive_duty = 0.31},
                                            [] { return false; }),
                  std::invalid_argument);
  CHECK_THROWS_AS(experiment::Commissioning(lab.driver, lab.clock, lab.person, lab.guard, {.brake_duty = 0.71},
                                            [] { return false; }),
                  std::invalid_argument);
}

TEST_CASE("A stop while turning by hand or while the wheels run out ends the commissioning") {
  OtherLab leaving;
  leaving.person.gives_up = true;
  CHECK(leaving.run() == CommissioningResult::declined);
  CHECK(leaving.guard.begun == 1);

  OtherLab stopping;
  stopping.board.on_read = [&] {
    stopping.stop = stopping.guard.ended_safe == 2 && stopping.clock.now_ns() > 1'000'000'000;
    if (stopping.guard.begun > 1) ++stopping.board.counters.lower_counts;  // the wheel keeps turning
    return driver::IoResult{};
  };
  CHECK(stopping.run() == CommissioningResult::interrupted);
  CHECK(stopping.guard.begun == 2);
}

TEST_CASE("Input that ends at a question ends the commissioning as declined, with no word of a failure") {
  for (int question = 1; question <= 5; ++question) {
    Lab lab;
    lab.person.leaves_at = question;
    CHECK(lab.run() == CommissioningResult::declined);
    CHECK_THAT(lab.person.said, !Contains("FAILED"));
  }
}

// What commissioning finds: wrong wiring, wheels, encoders, boards that fail.

#include <tuple>

#include "commissioning_labs.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;
using Catch::Matchers::Contains;
using experiment::CommissioningResult;

TEST_CASE("Wrong wiring is found and reported with its key") {
  driver::pci::PciOptions options;
  std::string words;
  SECTION("sign of the upper wheel") {
    options.upper_sign = -1;
    words = "change the sign of driver.pci.upper_sign";
  }
  SECTION("sign of the lower wheel") {
    options.lower_sign = -1;
    words = "change the sign of driver.pci.lower_sign";
  }
  SECTION("channels") {
    options.upper_channel = 0;
    options.lower_channel = 1;
    words = "swap driver.pci.upper_channel and driver.pci.lower_channel";
  }
  Lab lab(options);
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains(words));
  CHECK(largest_width(lab.card) == 0.0);  // nothing moved by itself
}

TEST_CASE("Messages name keys of the connected board") {
  const auto said_of = [](std::string_view kind, std::int32_t upper_counts, std::int32_t lower_counts) {
    OtherBoard board(kind);
    ModelCard unused;
    Guard guard(unused);
    runtime::VirtualClock clock;
    Person person;
    person.turn = [&](bool) {
      board.counters.upper_counts += upper_counts;
      board.counters.lower_counts += lower_counts;
    };
    CHECK(experiment::Commissioning(board, clock, person, guard, {}, [] { return false; }).run() ==
          CommissioningResult::failed);
    return person.said;
  };
  CHECK_THAT(said_of("usb", -2048, 0), Contains("change the sign of driver.usb.upper_sign"));
  CHECK_THAT(said_of("can", -2048, 0), Contains("change the sign of driver.can.upper_sign"));
  CHECK_THAT(said_of("usb", 0, 2048), Contains("swap driver.usb.upper_channel and driver.usb.lower_channel"));
  const std::string node = said_of("can", 0, 2048);
  CHECK_THAT(node, Contains("exchange the two encoders at the node"));
  CHECK_THAT(node, !Contains("_channel"));
}

TEST_CASE("Wheels that do not turn, or that turn each other, are found") {
  Lab lab;
  std::string words;
  SECTION("no turn") {
    lab.person.turn = [](bool) {};
    words = "too few";
  }
  SECTION("wheels in contact") {
    lab.person.turn = [&lab](bool upper) {
      lab.card.model.turn_by_hand(upper, 1.0);
      lab.card.model.turn_by_hand(!upper, -1.0);
    };
    words = "lift the upper wheel";
  }
  SECTION("E-stop pressed during the drive pulse") {
    lab.card.model.press_emergency_stop(true);
    words = "the E-stop is pressed";
  }
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains(words));
}

TEST_CASE("An encoder of another scale is found by one turn by hand, within 3 %, and the counts are kept") {
  // Counts of one turn of the upper and lower wheel; the model says 4096.
  const auto [upper, lower, passes] =
      GENERATE(std::tuple(4096, 4096, true), std::tuple(4000, 4200, true), std::tuple(4506, 4506, false),
               std::tuple(8192, 8192, false), std::tuple(2048, 2048, false), std::tuple(4096, 3900, false));
  OtherLab lab;
  lab.person.turn = [&lab, upper = upper, lower = lower](bool is_upper) {
    (is_upper ? lab.board.counters.upper_counts : lab.board.counters.lower_counts) += is_upper ? upper : lower;
  };
  experiment::Commissioning commissioning(lab.board, lab.clock, lab.person, lab.guard, lab.options,
                                          [] { return false; });
  CHECK((commissioning.run() == CommissioningResult::passed) == passes);
  if (passes) {
    CHECK(commissioning.one_turn().upper == upper);
    CHECK(commissioning.one_turn().lower == lower);
  } else {
    CHECK_THAT(lab.person.said, Contains("model.encoder_counts_per_rev"));
  }
  OtherLab coarse;  // the same turn of an encoder that the model knows to be coarser
  coarse.options.encoder_counts_per_rev = 1024;
  coarse.person.turn = [&coarse](bool is_upper) {
    (is_upper ? coarse.board.counters.upper_counts : coarse.board.counters.lower_counts) += 1024;
  };
  CHECK(coarse.run() == CommissioningResult::passed);
}

TEST_CASE("Counters of 16 bits are followed while a wheel is turned by hand") {
  const auto [one_turn, in_model, passes] = GENERATE(std::tuple(40000, 40000, true), std::tuple(69632, 4096, false));
  OtherLab lab;
  std::int32_t raw = 0;  // of the upper wheel; the driver sees its low 16 bits
  lab.options.encoder_counts_per_rev = in_model;
  lab.person.parts = 20;
  lab.person.turn = [&, one_turn = one_turn](bool upper) {
    (upper ? raw : lab.board.counters.lower_counts) += one_turn / 20;
  };
  lab.person.enter = [&, one_turn = one_turn](bool upper) {
    (upper ? raw : lab.board.counters.lower_counts) += one_turn % 20;
  };
  lab.board.on_read = [&]() -> driver::IoResult {
    lab.board.counters.upper_counts += static_cast<std::int16_t>(raw - lab.board.counters.upper_counts);
    return {};
  };
  CHECK((lab.run() == CommissioningResult::passed) == passes);
  INFO(lab.person.said);
  if (!passes) CHECK_THAT(lab.person.said, Contains("69632 counts are 17.000 turns"));
}

TEST_CASE("A turn is judged by an answer from after it, not by one that a driver repeats") {
  OtherLab lab;
  lab.person.turn = [](bool) {};
  int lost = 0;
  SECTION("three answers lost") { lost = 3; }
  SECTION("no answer any more") { lost = 1000; }
  lab.person.enter = [&](bool upper) {
    (upper ? lab.board.counters.upper_counts : lab.board.counters.lower_counts) += 4096;
    lab.board.lost_answers = lost;
  };
  CHECK((lab.run() == CommissioningResult::passed) == (lost == 3));
  CHECK_THAT(lab.person.said, !Contains("too few"));
  if (lost > 3) CHECK_THAT(lab.person.said, Contains("FAILED: the board did not answer 20 times in a row"));
}

TEST_CASE("An error is named by the backend's reason, as in a run") {
  OtherLab lab;
  lab.board.on_write = [](const rig::Command& command) -> driver::IoResult {
    if (command.motor_duty == 0.0) return {};
    return {driver::IoError::read_back_mismatch, 0xd00, 0, rig::Reason::hm2_watchdog_bit};
  };
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains(std::string(rig::description(rig::Reason::hm2_watchdog_bit)) + ": register"));
}

TEST_CASE("A board that fails in a pulse ends it with a message about the failed step") {
  OtherLab lab;
  std::string words;
  int pulses_ended_safe = 1;
  SECTION("reading") {
    lab.board.on_read = [&lab]() -> driver::IoResult {
      return {lab.guard.beats < 10 ? driver::IoError::none : driver::IoError::no_answer};
    };
    words = "FAILED: cannot read the board: board did not answer in time";
  }
  SECTION("writing") {
    lab.board.on_write = [](const rig::Command& command) -> driver::IoResult {
      return {command.motor_duty > 0.0 ? driver::IoError::stalled : driver::IoError::none};
    };
    words = "FAILED: cannot write to the board: board refuses the transfer";
  }
  SECTION("the zeros at its end") {
    lab.board.on_write = [](const rig::Command& command) -> driver::IoResult {
      return {command.motor_duty > 0.0 ? driver::IoError::none : driver::IoError::disconnected};
    };
    words = "FAILED: cannot end the pulse: board is gone";
    pulses_ended_safe = 0;
  }
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains(words));
  CHECK(lab.guard.begun == 2);
  CHECK(lab.guard.ended_safe == 1 + pulses_ended_safe);
  CHECK_FALSE(lab.guard.acting);
  CHECK(lab.person.asked.size() == 3);
}

TEST_CASE("After the pulses: wheels that do not stop, a brake that drives, one that does not grip") {
  OtherLab lab;
  std::string words;
  SECTION("no standstill") {
    lab.board.on_read = [&lab] {
      if (lab.guard.begun > 1) ++lab.board.counters.lower_counts;
      return driver::IoResult{};
    };
    words = "the wheels still turn after the run-out limit";
  }
  SECTION("drive and brake exchanged") {
    lab.board.on_write = [&lab](const rig::Command& command) {
      if (command.motor_duty > 0.0 || command.brake_duty > 0.0) ++lab.board.counters.lower_counts;
      return driver::IoResult{};
    };
    words = "check whether drive and brake are exchanged";
  }
  SECTION("nothing seen of the brake") {
    lab.person.no_to = 5;
    words = "check the brake's supply and cable";
  }
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains(words));
  CHECK(lab.board.state() == driver::DriverState::inactive);
}

TEST_CASE("A safe state that did not reach the board is not a success") {
  OtherLab lab;
  lab.person.before_answer = [&lab] {
    if (lab.person.asked.size() == 5) lab.board.made_safe = {driver::IoError::disconnected};
  };
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains("the safe state may not have reached the board: board is gone"));
}

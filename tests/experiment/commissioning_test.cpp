#include "experiment/commissioning.hpp"

#include <functional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "catch.hpp"
#include "commissioning_people.hpp"
#include "driver/pci/model_card.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;
using experiment::CommissioningResult;
using experiment::test::Guard;
using experiment::test::Person;

namespace {

struct Lab {
  explicit Lab(const driver::pci::PciOptions& options = {}) : driver(options, card.opener()) {
    person.turn = [this](bool upper) { card.model.turn_by_hand(upper, 1.0); };
    person.take_time = [this] { clock.sleep_until(clock.now_ns() + 2'000'000'000); };
    // Nothing may act while a question stands.
    person.before_answer = [this] {
      CHECK(card.model.outputs().drive_duty == 0.0);
      CHECK(card.model.outputs().brake_duty == 0.0);
    };
  }
  CommissioningResult run() {
    return experiment::Commissioning(driver, clock, person, guard, {}, [this] { return stop; }).run();
  }

  test::ModelCard card{};
  driver::pci::PciDriver driver;
  runtime::VirtualClock clock{};
  Person person{};
  Guard guard{card};
  bool stop{false};
};

/// A board of another kind: counters, and what comes of reading, writing and making safe.
class OtherBoard final : public driver::RigDriver {
 public:
  explicit OtherBoard(std::string_view kind) : kind_(kind) {}
  [[nodiscard]] std::string_view name() const noexcept override { return kind_; }
  rig::Measurement counters{};
  std::function<driver::IoResult()> on_read{[] { return driver::IoResult{}; }};
  std::function<driver::IoResult(const rig::Command&)> on_write{[](const rig::Command&) { return driver::IoResult{}; }};
  driver::IoResult made_safe{};
  std::function<bool(rig::Command&)> on_outputs{[](rig::Command&) { return false; }};
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override { return on_outputs(applied); }
  std::string_view cable{};
  [[nodiscard]] std::string_view watched_cable() const noexcept override { return cable; }
  int rests{0};

 private:
  void do_configure() override {}
  void do_activate(std::int64_t /*now_ns*/) override {}
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    const driver::IoResult result = on_read();
    measurement = counters;
    measurement.time_ns = now_ns;
    return result;
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    sent = as_sent(command);
    return on_write(command);
  }
  driver::IoResult do_make_safe() noexcept override { return made_safe; }
  driver::IoResult do_rest() noexcept override {
    ++rests;
    return {};
  }

  std::string_view kind_;
};

/// A rig on such a board that does what it should: each test lets one thing go wrong.
struct OtherLab {
  OtherLab() {
    person.turn = [this](bool upper) { (upper ? board.counters.upper_counts : board.counters.lower_counts) += 4096; };
    board.on_write = [this](const rig::Command& command) {
      if (command.motor_duty > 0.0) ++board.counters.lower_counts;
      return driver::IoResult{};
    };
  }
  CommissioningResult run() {
    return experiment::Commissioning(board, clock, person, guard, options, [this] { return stop; }).run();
  }

  OtherBoard board{"usb"};
  test::ModelCard unused{};
  Guard guard{unused};
  runtime::VirtualClock clock{};
  Person person{};
  experiment::CommissioningOptions options{};
  bool stop{false};
};

double largest_width(const test::ModelCard& card) {
  double most = 0.0;
  for (const auto& access : card.traffic) {
    if (access.is_write && access.offset == 0x6C) most = std::max(most, static_cast<double>(access.value) / 4095.0);
  }
  return most;
}

}  // namespace

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
  const test::ModelCard none;
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
    const bool wrote =
        std::any_of(lab.card.traffic.begin(), lab.card.traffic.end(), [](auto& a) { return a.is_write; });
    CHECK(wrote == (step > 2));
    CHECK((largest_width(lab.card) > 0.0) == (step > 3));
  }
}

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
    test::ModelCard unused;
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

TEST_CASE("A tripped interlock and a request to stop end a pulse at once") {
  Lab lab;
  SECTION("trip") {
    lab.person.before_answer = [&lab] {
      if (lab.person.asked.size() == 3) lab.card.model.set_supply_V(5.0);
    };
    CHECK(lab.run() == CommissioningResult::failed);
    CHECK_THAT(lab.person.said, Contains("interlocks have tripped"));
  }
  SECTION("stop") {
    lab.person.before_answer = [&lab] { lab.stop = lab.person.asked.size() == 3; };
    CHECK(lab.run() == CommissioningResult::interrupted);
  }
  CHECK(lab.card.model.outputs().drive_duty == 0.0);
  CHECK(lab.clock.now_ns() < 4'100'000'000);
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

namespace {

/// The person pulls the cable after 0.3 s of driving, and plugs it in again 0.05 s later; `runs_away` counts come
/// between two reads from then on.
struct CableLab : OtherLab {
  explicit CableLab(std::int32_t counts_when_back) : runs_away(counts_when_back) {
    board.cable = "Ethernet cable";
    board.on_read = [this]() -> driver::IoResult {
      constexpr int pulled_at = 300;
      constexpr int plugged_at = 350;
      if (person.said.find("Pull the Ethernet cable now") == std::string::npos) return {};
      ++reads;
      if (reads < pulled_at) return {};
      if (reads < plugged_at) return {driver::IoError::no_answer};
      if (reads == plugged_at) return {driver::IoError::read_back_mismatch};
      if (reads <= plugged_at + 2) board.counters.lower_counts += runs_away;
      return {};
    };
  }
  std::int32_t runs_away;
  int reads{0};
};

}  // namespace

TEST_CASE("A board that watches its cable has it pulled while the drive is on: the wheels must coast") {
  CableLab lab(90);
  CHECK(lab.run() == CommissioningResult::passed);
  INFO(lab.person.said);
  CHECK(lab.person.asked.size() == 7);
  CHECK_THAT(lab.person.asked.at(3), Contains("Step 4 of 5"));
  CHECK_THAT(lab.person.said, Contains("made 100 counts in 0.1 s before the cable was pulled and 90 after"));
  CHECK(lab.board.rests == 4);  // after each activation and each pulse
}

TEST_CASE("Wheels that go faster without the cable show outputs of the wrong polarity") {
  CableLab lab(200);
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains("Wire them active-low"));
}

TEST_CASE("A cable that nobody pulls ends the commissioning, the drive off") {
  OtherLab lab;
  lab.board.cable = "Ethernet cable";
  CHECK(lab.run() == CommissioningResult::failed);
  CHECK_THAT(lab.person.said, Contains("the cable was not pulled"));
  CHECK(lab.board.state() == driver::DriverState::inactive);
}

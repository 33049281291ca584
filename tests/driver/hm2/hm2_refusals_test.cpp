// Boards and options that are refused, and the writer that makes a board safe from another process.

#include "active_rig.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::test;
using Catch::Matchers::Contains;
using rig::Reason;

namespace {

std::string refusal(RegisterBoard& board, const Hm2Options& options = {}) {
  Cable cable(board);
  Hm2Driver driver(options, cable.opener());
  try {
    driver.configure();
    driver.activate(0);
  } catch (const Unavailable& error) {
    CHECK(board.outputs().drive_duty + board.outputs().brake_duty == 0.0);
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("A board whose outputs are on is another program's: refused") {
  RegisterBoard board;
  board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x00, 0x11, 2, 0, 0, 0});
  Cable cable(board);
  Hm2Driver driver({}, cable.opener());
  const std::uint64_t writes = board.writes;
  CHECK_THROWS_WITH(driver.configure(), Contains("another program drives it"));
  CHECK(board.writes == writes);
}

TEST_CASE("A board whose driving program lets go at the first datagram of another one is refused all the same") {
  RegisterBoard board;
  board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x00, 0x11, 2, 0, 0, 0});
  board.bites_after = 2;
  Cable cable(board);
  Hm2Driver driver({}, cable.opener());
  CHECK_THROWS_WITH(driver.configure(), Contains("another program drives it"));
  CHECK(board.ddr()[0] == 0);
}

TEST_CASE("A board that describes what cannot be, or what is not known, is refused with the fact") {
  struct Lie {
    std::uint16_t address;
    std::uint32_t value;
    const char* fact;
  };
  // clang-format off
  for (const Lie& lie : {Lie{0x100, 0x55AACAFF, "cookie is 0x55aacaff"},
                         Lie{0x104, 0, "HOSTMOT2"},
                         Lie{0x10C, 0xFFF0, "outside its space"},
                         Lie{0x400, 4, "IDROM has type 4"},
                         Lie{0x404, 0xFFFFFF00, "outside its space"},
                         Lie{0x408, 0xFFF0, "outside its space"},
                         Lie{0x41C, 200, "200 ports"},
                         Lie{0x420, 35, "claims 35 I/O pins"},
                         Lie{0x428, 0, "ClockLow is 0 Hz"},
                         Lie{0x42C, 0xFFFFFFFF, "ClockHigh is 4294967295 Hz"},
                         Lie{0x440, 0x01010102, "watchdog module has the unknown version 1"},
                         Lie{0x440, 0x01010099, "it has 0 watchdogs, the rig needs 1"},
                         Lie{0x444, 0x0003FFF0, "watchdog module has base 0xfff0"},
                         Lie{0x444, 0x00030100, "watchdog module has base 0x100"},
                         Lie{0x444, 0x00040C00, "watchdog module has 4 registers"},
                         Lie{0x44C, 0x03010003, "3 I/O port instances and 2 ports"},
                         Lie{0x458, 0xFF010204, "quadrature counter module claims 255 instances"},
                         Lie{0x458, 0x01010204, "it has 1 quadrature counter, the rig needs 2"},
                         Lie{0x458, 0x02010404, "quadrature counter module has the unknown version 4"},
                         Lie{0x45C, 0x22053000, "names clock 1 and strides 0x22"},
                         Lie{0x464, 0x02070006, "names clock 7"},
                         Lie{0x464, 0x01020006, "it has 1 PWM, the rig needs 2"},
                         Lie{0x468, 0x0005FC00, "PWM module has base 0xfc00"},
                         Lie{0x45C, 0x00051000, "I/O port and its quadrature counter module both have the register 0x1000"},
                         Lie{0x468, 0x00050C00, "watchdog and its PWM module both have the register 0xc00"},
                         Lie{0x468, 0x00050E00, "watchdog and its PWM module both have the register 0xe00"},
                         Lie{0x46C, 0xFF, "bitmap 0xff"},
                         Lie{0x470, 0x02020006, "PWM module twice"},
                         Lie{0x600, 0x05000000, "pin 0 has the primary function 5"},
                         Lie{0x604, 0x03000000, "drive_pwm = 0: this firmware brings that PWM to no I/O pin, but 1 (I/O 18)"},
                         Lie{0x438, 0, "register stride 0"}}) {
    // clang-format on
    RegisterBoard board;
    board.rom[lie.address] = lie.value;
    CAPTURE(lie.address, lie.value);
    CHECK_THAT(refusal(board), Contains(lie.fact));
    CHECK(board.writes == 0);
  }
  RegisterBoard old;
  old.info_[0x10] = 2;
  CHECK_THAT(refusal(old), Contains("version 2 of LBP16"));
  RegisterBoard good;
  CHECK(refusal(good) == "accepted");
}

TEST_CASE("Options that the board cannot have are refused, naming the key") {
  const auto said = [](const Hm2Options& options) {
    RegisterBoard board;
    return refusal(board, options);
  };
  CHECK_THAT(said({.drive_pwm = 5}), Contains("driver.hm2.drive_pwm = 5: the board has the instances 0 to 1"));
  CHECK_THAT(said({.upper_channel = 7}), Contains("driver.hm2.upper_channel = 7"));
  CHECK_THAT(said({.brake_pin = 3}), Contains("driver.hm2.brake_pin = 3, but the board has that PWM at I/O pin 18"));
  CHECK_THAT(said({.relay_pin = 40}), Contains("driver.hm2.relay_pin = 40: the board has the I/O pins 0 to 33"));
  CHECK_THAT(said({.relay_pin = 1}), Contains("I/O pin 1 has two uses"));
  CHECK_THAT(said({.relay_pin = 13}), Contains("driver.hm2.relay_pin = 13: this I/O pin is an input of an encoder's"));
  CHECK_THAT(said({.enable_pin = 31}), Contains("driver.hm2.enable_pin = 31: this I/O pin is an input"));
  CHECK(said({.drive_pin = -1, .brake_pin = -1}) == "accepted");
  RegisterBoard board;
  Cable cable(board);
  CHECK_THROWS_WITH(Hm2Driver({.watchdog_ms = 4}, cable.opener()), Contains("driver.hm2.watchdog_ms"));
  CHECK_THROWS_WITH(Hm2Driver({.drive_pwm = 1}, cable.opener()), Contains("different PWMs"));
  CHECK_THROWS_WITH(Hm2Driver({.answer_timeout_us = 900}, cable.opener()), Contains("at most 800 us"));
  for (const char* bad : {"", "board", "1.2.3", "1.2.3.4:", "1.2.3.4:0", "1.2.3.4:70000", "1.2.3.4:1x", "::1"}) {
    CHECK_THROWS_WITH(hm2::parse_address(bad), Contains("driver.hm2.address"));
  }
  CHECK(ntohs(hm2::parse_address("10.0.0.1").sin_port) == 27181);
  CHECK(ntohs(hm2::parse_address("10.0.0.1:5000").sin_port) == 5000);
}

TEST_CASE("A board without an emulator's mark is none, whatever its address and driver.emulated say") {
  RegisterBoard board;
  Cable cable(board);
  Hm2Driver claimed({}, cable.opener(), nullptr, false, true);
  CHECK_THROWS_AS(claimed.configure(), std::invalid_argument);  // status 2
  CHECK_THROWS_WITH(claimed.configure(), Contains("carries no emulator's mark") && Contains("driver.emulated"));
  CHECK(board.writes == 0);
  Hm2Driver real({}, cable.opener());
  CHECK_NOTHROW(real.configure());
}

TEST_CASE("The safe-state writer drops all outputs beside a stopped owner, whether or not it is answered") {
  for (const bool answered : {true, false}) {
    Rig rig;
    Cable own(rig.board);
    const auto writer = hm2::safe_state_writer({}, own.opener());
    writer->prepare();
    REQUIRE(rig.cycles(10, drive).ok());
    REQUIRE(rig.is_on());
    own.loses_answer = [&](const auto&) { return !answered; };
    CHECK(writer->make_safe().ok() == answered);
    CHECK_FALSE(rig.is_on());
    CHECK(rig.board.written[0x4000] == 0);
    CHECK(rig.board.written[0x4400] == 0);
    // The owner goes on. Its petting brings nothing back.
    for (int i = 0; i < 10; ++i) {
      static_cast<void>(rig.cycle(drive));
      CHECK_FALSE(rig.is_on());
    }
  }
}

TEST_CASE("The safe-state writer's look writes nothing while all pins are inputs, and zeros otherwise") {
  RegisterBoard board;
  Cable cable(board);
  const auto writer = hm2::safe_state_writer({}, cable.opener());
  writer->prepare();
  CHECK(board.writes == 0);
  CHECK(writer->verify_safe().ok());
  CHECK(board.writes == 0);
  board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x04, 0x11, 2, 0, 0, 0});
  CHECK(writer->verify_safe().error == IoError::foreign_writer);
  CHECK(board.ddr() == std::array<std::uint32_t, 2>{0, 0});
  CHECK(writer->verify_safe().ok());
}

TEST_CASE(
    "While the safe-state writer identifies a board whose first zeros were lost, zeros go out before each request") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  Cable own(rig.board);
  int sent = 0;
  int while_on = 0;
  own.loses_request = [&](const auto&) {
    while_on += rig.is_on() ? 1 : 0;
    return ++sent == 1;
  };
  const auto writer = hm2::safe_state_writer({}, own.opener());
  CHECK(writer->make_safe().ok());
  CHECK(sent > 20);
  CHECK(while_on == 3);  // the lost zeros, the look, the next zeros
}

TEST_CASE("A writer that has never been answered sends zeros to the usual addresses, and finds the board later") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  Cable own(rig.board);
  own.loses_answer = [](const auto&) { return true; };
  const auto writer = hm2::safe_state_writer({}, own.opener());
  CHECK_FALSE(writer->make_safe().ok());
  CHECK_FALSE(rig.is_on());
  own.out = true;
  const auto late = hm2::safe_state_writer({}, own.opener());
  CHECK_THROWS_AS(late->prepare(), Unavailable);
  CHECK_FALSE(late->make_safe().ok());
  const auto forbidden =
      hm2::safe_state_writer({}, []() -> std::unique_ptr<hm2::Link> { throw hm2::NoSocket(EAFNOSUPPORT); });
  CHECK_THAT(error_text(forbidden->make_safe()), Contains("Address family not supported"));
}

TEST_CASE("The safe-state writer reads the description of a board anew that was silent for three looks") {
  RegisterBoard board;
  Cable own(board);
  int sent = 0;
  own.loses_request = [&](const auto&) {
    ++sent;
    return false;
  };
  for (const int silent : {2, 3}) {
    const auto writer = hm2::safe_state_writer({}, own.opener());
    writer->prepare();
    own.loses_answer = [](const auto&) { return true; };
    for (int look = 0; look < silent; ++look) CHECK_FALSE(writer->make_safe().ok());
    own.loses_answer = [](const auto&) { return false; };
    sent = 0;
    CHECK(writer->make_safe().ok());
    CHECK((sent > 10) == (silent == 3));
  }
}

// The driver's promises on a board in virtual time: what acts, what is counted, what ends a run and stays ended.

#include <random>

#include "catch.hpp"
#include "driver/hm2/hm2_safe_state.hpp"
#include "register_board.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::test;
using Catch::Matchers::Contains;
using hm2::Hm2Driver;
using hm2::Hm2Options;
using rig::Reason;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr rig::Command drive{.motor_duty = 0.5, .motor_enable = true};
constexpr rig::Command brake{.brake_duty = 0.25};

/// A board, its cable and a driver that is active, with a cycle of 1 ms.
struct Rig {
  explicit Rig(const Hm2Options& options = {}, double speed_rad_s = 0.0)
      : board(speed_rad_s), driver(options, cable.opener()) {
    driver.configure();
    driver.activate(0);
  }
  /// One cycle as the executive makes it.
  IoResult cycle(const rig::Command& command) {
    now_ns += ms;
    board.advance_to(now_ns);
    IoResult result = driver.read(now_ns, measurement);
    if (!result.ok()) return result;
    return driver.write(command, sent);
  }
  IoResult cycles(int count, const rig::Command& command) {
    IoResult result{};
    for (int i = 0; i < count && result.ok(); ++i) result = cycle(command);
    return result;
  }
  /// Time passes without the program until both outputs are 0; returns how long that took.
  std::int64_t until_off() {
    const std::int64_t from_ns = now_ns;
    while (is_on() && now_ns < from_ns + 1000 * ms) board.advance_to(now_ns += ms / 10);
    return now_ns - from_ns;
  }
  [[nodiscard]] bool is_on() const { return board.outputs().drive_duty + board.outputs().brake_duty > 0.0; }

  RegisterBoard board;
  Cable cable{board};
  Hm2Driver driver;
  std::int64_t now_ns{0};
  rig::Measurement measurement{};
  rig::Command sent{};
};

bool is_cycle_write(const RegisterBoard::Bytes& request) { return request.size() == 40; }
bool is_cycle_read(const RegisterBoard::Bytes& request) { return request.size() == 44; }

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

TEST_CASE("The cycle's datagrams have the sizes of docs/hm2.md") {
  std::vector<std::size_t> sizes;
  std::size_t answer = 0;
  Rig rig;
  rig.cable.loses_request = [&](const auto& request) {
    sizes.push_back(request.size());
    return false;
  };
  rig.cable.loses_answer = [&](const auto& bytes) {
    answer = bytes.size();
    return false;
  };
  REQUIRE(rig.cycle(drive).ok());
  CHECK(sizes == std::vector<std::size_t>{44, 40});
  CHECK(answer == 54);
}

TEST_CASE(
    "Without commands the board drops its outputs after the watchdog's time, and cable or program do not matter") {
  for (const std::int32_t watchdog_ms : {5, 20}) {
    for (const rig::Command& command : {drive, brake}) {
      Rig rig({.watchdog_ms = watchdog_ms});
      REQUIRE(rig.cycles(50, command).ok());
      REQUIRE(rig.is_on());
      CHECK(rig.until_off() <= (watchdog_ms + 2) * ms);
      CHECK(rig.board.bitten == 1);
    }
  }
}

TEST_CASE("A bite ends the run with a reason of its own, and nothing but a new activation brings outputs back") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  rig.board.bite();
  const IoResult result = rig.cycle(drive);
  CHECK(result.reason == Reason::hm2_watchdog_bit);
  for (int i = 0; i < 100; ++i) {
    rig.now_ns += ms;
    rig.board.advance_to(rig.now_ns);
    rig::Measurement ignored;
    static_cast<void>(rig.driver.read(rig.now_ns, ignored));
    static_cast<void>(rig.driver.write(i % 2 == 0 ? drive : rig::safe_command, rig.sent));
    CHECK(rig.sent.motor_duty == 0.0);
    REQUIRE_FALSE(rig.is_on());
    REQUIRE(rig.board.bitten == 1);
  }
  rig.driver.configure();
  rig.driver.activate(rig.now_ns);
  REQUIRE(rig.cycles(3, drive).ok());
  CHECK(rig.is_on());
}

TEST_CASE("A bite while answers are lost is found, not erased: after a loss nothing is written before an answer") {
  bool lose = true;
  std::vector<std::size_t> sent_while_lost;
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  rig.cable.loses_answer = [&](const auto&) { return lose; };
  rig.cable.loses_request = [&](const auto& request) {
    if (lose) sent_while_lost.push_back(request.size());
    return false;
  };
  REQUIRE(rig.cycles(3, brake).ok());
  rig.board.bite();
  REQUIRE(rig.cycles(3, brake).ok());
  for (const std::size_t size : sent_while_lost) CHECK(size == 44);    // reads alone
  CHECK(rig.sent.motor_duty == rig.driver.as_sent(drive).motor_duty);  // the board has had no other command
  lose = false;
  CHECK(rig.cycle(brake).reason == Reason::hm2_watchdog_bit);
  CHECK_FALSE(rig.is_on());
  CHECK(rig.driver.counters().withheld == 6);
}

TEST_CASE("One datagram in a hundred is lost: the run goes on, each loss is counted, outputs never drop") {
  Rig rig({.watchdog_ms = 5}, 100.0);
  std::mt19937 random(7);
  std::uint64_t lost_reads = 0;
  std::uint64_t lost_writes = 0;
  bool this_read_lost = false;
  const auto one_in_100 = [&] { return random() % 100 == 0; };
  rig.cable.loses_request = [&](const auto& request) {
    const bool lost = one_in_100();
    if (is_cycle_read(request)) this_read_lost = lost;
    lost_reads += is_cycle_read(request) && lost ? 1 : 0;
    lost_writes += is_cycle_write(request) && lost ? 1 : 0;
    return lost;
  };
  rig.cable.loses_answer = [&](const auto&) {
    const bool lost = one_in_100();
    lost_reads += lost ? 1 : 0;
    return lost;
  };
  for (int i = 0; i < 5000; ++i) {
    REQUIRE(rig.cycle(drive).ok());
    REQUIRE((i == 0 || rig.is_on()));
  }
  rig.cable.loses_request = rig.cable.loses_answer = [](const auto&) { return false; };
  REQUIRE(rig.cycle(drive).ok());
  CHECK(lost_reads > 50);
  CHECK(lost_writes > 20);
  CHECK(rig.driver.counters().unanswered == lost_reads);
  CHECK(rig.driver.counters().withheld == lost_reads);
  // A write that is lost just before a lost answer is known only if no later one has come meanwhile.
  CHECK(rig.driver.counters().writes_lost <= lost_writes);
  CHECK(rig.driver.counters().writes_lost >= lost_writes - 3);
}

TEST_CASE("Nine losses in a row are survived, ten are a fault, and the outputs are off") {
  for (const int losses : {9, 10}) {
    Rig rig;
    REQUIRE(rig.cycles(10, drive).ok());
    rig.cable.out = true;
    const IoResult lost = rig.cycles(losses, drive);
    rig.cable.out = false;
    if (losses == 9) {
      CHECK(lost.ok());
      CHECK(rig.cycles(20, drive).ok());
      CHECK(rig.is_on());
    } else {
      CHECK(lost.error == IoError::no_answer);
      CHECK(lost.reason == Reason::hm2_silent);
      CHECK(rig.until_off() <= 12 * ms);  // of the watchdog's 20 ms ten have passed
      CHECK(rig.driver.deactivate().ok());
    }
  }
}

TEST_CASE("The cable is out for a while: outputs off in the watchdog's time, and they stay off when it is in again") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  rig.cable.out = true;
  const std::int64_t out_ns = rig.now_ns;
  std::int64_t off_ns = 0;
  IoResult result{};
  for (int i = 0; i < 100; ++i) {
    if (result.ok()) result = rig.cycle(drive);
    if (!result.ok()) {
      rig.board.advance_to(rig.now_ns += ms);
      static_cast<void>(rig.driver.write(drive, rig.sent));
    }
    if (off_ns == 0 && !rig.is_on()) off_ns = rig.now_ns;
  }
  CHECK(off_ns - out_ns <= 22 * ms);
  CHECK(result.reason == Reason::hm2_silent);
  rig.cable.out = false;
  for (int i = 0; i < 100; ++i) {
    rig.board.advance_to(rig.now_ns += ms);
    static_cast<void>(rig.driver.read(rig.now_ns, rig.measurement));
    static_cast<void>(rig.driver.write(drive, rig.sent));
    CHECK_FALSE(rig.is_on());
  }
}

TEST_CASE("A cable that was pulled between answer and write: in again, the board is heard, and says that it bit") {
  Rig rig;
  REQUIRE(rig.cycles(5, drive).ok());
  rig.cable.loses_request = is_cycle_write;
  REQUIRE(rig.cycle(drive).ok());
  rig.cable.loses_request = [](const auto&) { return false; };
  rig.cable.out = true;
  IoResult result{};
  for (int n = 0; n < 30; ++n) {
    rig.board.advance_to(rig.now_ns += ms);
    result = rig.driver.read(rig.now_ns, rig.measurement);
  }
  CHECK(result.error == IoError::no_answer);
  rig.cable.out = false;
  rig.board.advance_to(rig.now_ns += ms);
  result = rig.driver.read(rig.now_ns, rig.measurement);
  CHECK(result.error == IoError::read_back_mismatch);
  CHECK(result.reason == Reason::hm2_watchdog_bit);
}

TEST_CASE("A lost write is known by its number: the command that acts is the one before") {
  Rig rig;
  REQUIRE(rig.cycles(5, drive).ok());
  rig.cable.loses_request = is_cycle_write;
  REQUIRE(rig.cycle(brake).ok());
  rig.cable.loses_request = [](const auto&) { return false; };
  rig.board.advance_to(rig.now_ns += ms);
  REQUIRE(rig.driver.read(rig.now_ns, rig.measurement).ok());
  rig::Command acted;
  REQUIRE(rig.driver.took_other_command(acted));
  CHECK(acted.motor_duty == rig.driver.as_sent(drive).motor_duty);
  CHECK(acted.brake_duty == 0.0);
  CHECK(rig.driver.counters().writes_lost == 1);
  REQUIRE(rig.driver.write(brake).ok());
  REQUIRE(rig.cycle(brake).ok());
  CHECK_FALSE(rig.driver.took_other_command(acted));
}

TEST_CASE("Late and repeated answers are never used") {
  Rig rig({}, 100.0);
  REQUIRE(rig.cycles(10, brake).ok());
  const rig::Measurement before = rig.measurement;
  SECTION("late") {
    rig.cable.delays_answers = true;
    for (int i = 0; i < 5; ++i) {
      REQUIRE(rig.cycle(brake).ok());
      CHECK(rig.measurement.time_ns == before.time_ns);
      CHECK(rig.measurement.upper_counts == before.upper_counts);
    }
    CHECK(rig.driver.counters().unanswered == 5);
    CHECK(rig.driver.counters().stale == 4);
  }
  SECTION("repeated") {
    rig.cable.doubles_answers = true;
    for (int i = 0; i < 50; ++i) {
      REQUIRE(rig.cycle(brake).ok());
      CHECK(rig.measurement.time_ns == rig.now_ns);
    }
    CHECK(rig.driver.counters().unanswered == 0);
    CHECK(rig.driver.counters().stale == 49);
  }
}

TEST_CASE("16-bit counts are extended over their wrap, in both directions and with either sign") {
  for (const std::int32_t sign : {1, -1}) {
    Rig rig({.upper_sign = sign}, 170.0);
    REQUIRE(rig.cycles(1, rig::safe_command).ok());
    const std::int32_t first = rig.measurement.upper_counts;
    REQUIRE(rig.cycles(2000, rig::safe_command).ok());
    const double turns = sign * (rig.measurement.upper_counts - first) / 4096.0;
    CHECK(turns > 45.0);  // 170 rad/s for 2 s, less the bearings' friction
    CHECK(turns < 54.2);
  }
}

TEST_CASE("A slow start: the watchdog bites before the first command, which sets the outputs up with zeros") {
  Rig rig;
  rig.board.advance_to(rig.now_ns += 500 * ms);
  REQUIRE(rig.board.bitten == 1);
  REQUIRE(rig.cycle(drive).ok());
  CHECK(rig.sent.motor_duty == 0.0);
  CHECK_FALSE(rig.is_on());
  REQUIRE(rig.cycle(drive).ok());
  CHECK(rig.sent.motor_duty == rig.driver.as_sent(drive).motor_duty);
  CHECK(rig.is_on());
  rig.board.bite();
  CHECK(rig.cycle(drive).reason == Reason::hm2_watchdog_bit);
}

TEST_CASE("A slow start whose first write is lost is still a slow start") {
  Rig rig;
  rig.board.advance_to(rig.now_ns += 500 * ms);
  rig.cable.loses_request = [](const auto& request) { return request.size() > 100; };
  REQUIRE(rig.cycle(drive).ok());
  rig.cable.loses_request = [](const auto&) { return false; };
  REQUIRE(rig.cycles(2, drive).ok());
  CHECK(rig.is_on());
}

TEST_CASE("At rest the outputs are off and reading goes on; another program's looks are no fault then") {
  Rig rig({}, 50.0);
  REQUIRE(rig.cycles(10, drive).ok());
  REQUIRE(rig.cycle(rig::safe_command).ok());
  REQUIRE(rig.driver.rest().ok());
  CHECK(rig.board.ddr() == std::array<std::uint32_t, 2>{0, 0});
  const std::int32_t before = rig.measurement.lower_counts;
  for (int i = 0; i < 100; ++i) {
    rig.board.advance_to(rig.now_ns += ms);
    rig.board.handle(std::array<std::uint8_t, 4>{0x81, 0x42, 0x00, 0x11});
    REQUIRE(rig.driver.read(rig.now_ns, rig.measurement).ok());
  }
  CHECK(rig.measurement.lower_counts > before + 1000);
  REQUIRE(rig.cycles(2, drive).ok());
  CHECK(rig.is_on());
}

TEST_CASE("Faults of the board have reasons of their own and drop the outputs at once") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  Reason expected = Reason::none;
  SECTION("another program reads") {
    rig.board.handle(std::array<std::uint8_t, 4>{0x81, 0x42, 0x00, 0x11});
    expected = Reason::foreign_writer;
  }
  SECTION("another program leaves its number") {
    rig.board.handle(std::array<std::uint8_t, 8>{0x82, 0xD1, 0x14, 0, 77, 0, 0, 0});
    rig.board.forget_last_packet();
    expected = Reason::foreign_writer;
  }
  SECTION("quadrature error") {
    rig.board.control[1] = 0x8000;
    expected = Reason::hm2_quadrature_error;
  }
  SECTION("its supply failed for a moment") {
    rig.board.restart();
    expected = Reason::hm2_restarted;
  }
  SECTION("a pin is no output any more") {
    rig.board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x00, 0x11, 0, 0, 0, 0});
    rig.board.forget_last_packet();
    expected = Reason::hm2_outputs_off;
  }
  SECTION("counts jump") {
    rig.board.time_jump_counts = 5000;
    expected = Reason::hm2_values_implausible;
  }
  const IoResult result = rig.cycle(drive);
  CHECK(result.reason == expected);
  CHECK_FALSE(rig.is_on());
  CHECK(rig.driver.deactivate().ok());
}

TEST_CASE("The ages of the encoders' edges are the board's, to its tick of 0.5 us, also while a wheel stands") {
  Rig rig({}, 3.0);
  std::int32_t oldest_ns = 0;
  int cycles = 0;
  int unknown = 0;
  // A stamp of 16 bits wraps after 33 ms.
  for (; oldest_ns < 200 * ms && cycles < 6000; ++cycles) {
    REQUIRE(rig.cycle(rig::safe_command).ok());
    for (const bool upper : {false, true}) {
      const std::int32_t age_ns = upper ? rig.measurement.upper_edge_age_ns : rig.measurement.lower_edge_age_ns;
      unknown += age_ns == rig::no_edge_age ? 1 : 0;
      if (age_ns != rig::no_edge_age) REQUIRE(std::abs(rig.now_ns - rig.board.last_edge_ns(upper) - age_ns) <= 1000);
    }
    oldest_ns = std::min(rig.measurement.upper_edge_age_ns, rig.measurement.lower_edge_age_ns);
  }
  CHECK(cycles > 500);
  CHECK(unknown <= 2);  // before a wheel's first edge
  CHECK(oldest_ns >= 200 * ms);
}

TEST_CASE("A board that stamps no edges gives no ages") {
  Rig rig({}, 60.0);
  rig.board.stamps_edges = false;
  for (int i = 0; i < 100; ++i) {
    REQUIRE(rig.cycle(rig::safe_command).ok());
    REQUIRE(rig.measurement.upper_edge_age_ns == rig::no_edge_age);
    REQUIRE(rig.measurement.lower_edge_age_ns == rig::no_edge_age);
  }
}

TEST_CASE("An edge that may lie a wrap of its stamp back has no age") {
  Rig rig({}, 60.0);
  REQUIRE(rig.driver.rest().ok());
  for (const std::int64_t pause_ns : {20 * ms, 40 * ms, 20 * ms}) {
    rig.board.advance_to(rig.now_ns += pause_ns);
    REQUIRE(rig.driver.read(rig.now_ns, rig.measurement).ok());
    if (pause_ns == 40 * ms) CHECK(rig.measurement.lower_edge_age_ns == rig::no_edge_age);
  }
  CHECK(rig.measurement.lower_edge_age_ns >= 0);
  CHECK(rig.measurement.lower_edge_age_ns < 100'000);  // 39 counts a ms
}

TEST_CASE("Packets that are no datagrams are counted and end no run") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  for (int i = 0; i < 20; ++i) {
    ++rig.board.received.all;  // an ARP request
    REQUIRE(rig.cycle(drive).ok());
  }
  CHECK(rig.driver.counters().not_udp == 20);
  CHECK(rig.is_on());
}

TEST_CASE("On a board that does not count datagrams apart any packet of others ends the run") {
  RegisterBoard board;
  board.counts_udp = false;
  Cable cable(board);
  Hm2Driver driver({}, cable.opener());
  driver.configure();
  driver.activate(0);
  rig::Measurement measurement;
  std::int64_t now_ns = 0;
  for (int i = 0; i < 10; ++i) {
    board.advance_to(now_ns += ms);
    REQUIRE(driver.read(now_ns, measurement).ok());
    REQUIRE(driver.write(drive).ok());
  }
  ++board.received.all;
  board.advance_to(now_ns += ms);
  CHECK(driver.read(now_ns, measurement).reason == Reason::foreign_writer);
}

TEST_CASE("Another program is found although datagrams are lost") {
  std::mt19937 random(3);
  Rig rig;
  rig.cable.loses_request = [&](const auto&) { return random() % 50 == 0; };
  REQUIRE(rig.cycles(300, drive).ok());
  IoResult result{};
  int cycles = 0;
  for (; result.ok() && cycles < 20; ++cycles) {
    rig.board.handle(std::array<std::uint8_t, 4>{0x81, 0x42, 0x00, 0x11});
    result = rig.cycle(drive);
  }
  CHECK(result.reason == Reason::foreign_writer);
  CHECK(cycles <= 6);
}

TEST_CASE("A board whose outputs are on is another program's: refused") {
  RegisterBoard board;
  board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x00, 0x11, 2, 0, 0, 0});
  Cable cable(board);
  Hm2Driver driver({}, cable.opener());
  const std::uint64_t writes = board.writes;
  CHECK_THROWS_WITH(driver.configure(), Contains("another program drives it"));
  CHECK(board.writes == writes);
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
                         Lie{0x46C, 0xFF, "bitmap 0xff"},
                         Lie{0x470, 0x02020006, "PWM module twice"},
                         Lie{0x600, 0x05000000, "pin 0 has the primary function 5"},
                         Lie{0x604, 0x03000000, "drive_pin = 1, but the board has that PWM at I/O pin -1"},
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
  CHECK(said({.drive_pin = -1, .brake_pin = -1}) == "accepted");
  RegisterBoard board;
  Cable cable(board);
  CHECK_THROWS_WITH(Hm2Driver({.watchdog_ms = 4}, cable.opener()), Contains("driver.hm2.watchdog_ms"));
  CHECK_THROWS_WITH(Hm2Driver({.drive_pwm = 1}, cable.opener()), Contains("different PWM instances"));
  CHECK_THROWS_WITH(Hm2Driver({.answer_timeout_us = 900}, cable.opener()), Contains("at most 800 us"));
  for (const char* bad : {"", "board", "1.2.3", "1.2.3.4:", "1.2.3.4:0", "1.2.3.4:70000", "1.2.3.4:1x", "::1"}) {
    CHECK_THROWS_WITH(hm2::parse_address(bad), Contains("driver.hm2.address"));
  }
  CHECK(ntohs(hm2::parse_address("10.0.0.1").sin_port) == 27181);
  CHECK(ntohs(hm2::parse_address("10.0.0.1:5000").sin_port) == 5000);
}

TEST_CASE("The relay's pin changes with each command, the enabling pin follows the motor, both active-low") {
  Rig rig({.enable_pin = 0, .relay_pin = 7});
  REQUIRE(rig.cycle(drive).ok());
  const std::uint32_t first = rig.board.written[0x1000];
  REQUIRE(rig.cycle(drive).ok());
  const std::uint32_t second = rig.board.written[0x1000];
  CHECK((first & 1U) == 1U);
  CHECK((first ^ second) == 1U << 7U);
  REQUIRE(rig.cycle(rig::safe_command).ok());
  CHECK((rig.board.written[0x1000] & 1U) == 0U);
  CHECK((rig.board.written[0x1400] & 0x83U) == 0x83U);
  CHECK((rig.board.written[0x1100] & 0x83U) == 0x83U);
}

TEST_CASE("The identity for the commissioning record is name, versions and MAC") {
  Rig rig;
  CHECK(rig.driver.identity().place == "00:00:1b:60:3b:10");
  CHECK(rig.driver.identity().logic == "7I92, IDROM MESA7I92, LBP16 3, firmware 16");
}

TEST_CASE("The last 64 datagrams are kept with their times") {
  Rig rig;
  REQUIRE(rig.cycles(100, drive).ok());
  const auto lines = rig.driver.traffic();
  REQUIRE(lines.size() == 64);
  CHECK_THAT(lines.back(), Contains(" sent  40 82c20010"));
  CHECK_THAT(lines[lines.size() - 2], Contains(" got   54 "));
}

TEST_CASE("The safe-state writer drops all outputs beside a stopped owner, whether or not it is answered") {
  for (const bool answered : {true, false}) {
    Rig rig;
    Cable own(rig.board);
    hm2::Hm2SafeState writer({}, own.opener());
    writer.prepare();
    REQUIRE(rig.cycles(10, drive).ok());
    REQUIRE(rig.is_on());
    own.loses_answer = [&](const auto&) { return !answered; };
    CHECK(writer.make_safe().ok() == answered);
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
  hm2::Hm2SafeState writer({}, cable.opener());
  writer.prepare();
  CHECK(board.writes == 0);
  CHECK(writer.verify_safe().ok());
  CHECK(board.writes == 0);
  board.handle(std::array<std::uint8_t, 8>{0x81, 0xC2, 0x04, 0x11, 2, 0, 0, 0});
  CHECK(writer.verify_safe().error == IoError::foreign_writer);
  CHECK(board.ddr() == std::array<std::uint32_t, 2>{0, 0});
  CHECK(writer.verify_safe().ok());
}

TEST_CASE("A writer that has never been answered sends zeros to the usual addresses, and finds the board later") {
  Rig rig;
  REQUIRE(rig.cycles(10, drive).ok());
  Cable own(rig.board);
  own.loses_answer = [](const auto&) { return true; };
  hm2::Hm2SafeState writer({}, own.opener());
  CHECK_FALSE(writer.make_safe().ok());
  CHECK_FALSE(rig.is_on());
  own.out = true;
  hm2::Hm2SafeState late({}, own.opener());
  CHECK_THROWS_AS(late.prepare(), Unavailable);
  CHECK_FALSE(late.make_safe().ok());
}

// Lost datagrams, cables, bites and other talkers: what acts, what is counted, what ends a run and stays ended.

#include <random>

#include "active_rig.hpp"

using namespace abs_hil;
using namespace abs_hil::driver;
using namespace abs_hil::test;
using Catch::Matchers::Contains;
using rig::Reason;

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

// The registers of the emulated 7I92T: pins, watchdog, PWM, counters, power.

#include <cmath>

#include "abs_hil/plant_sim/plant.hpp"
#include "hm2_datagrams.hpp"

using namespace abs_hil;
using namespace abs_hil::emulator;
using namespace abs_hil::test;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("After power-on the watchdog has bitten, no pin is driven, all are pulled high") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  CHECK(read32(board, 0x0D00) == 1);
  CHECK(read32(board, 0x0C00) == 0x80000000);
  CHECK(read32(board, 0x1100) == 0);
  CHECK((read32(board, 0x1000) & 0x1FFF) == 0x1FFF);
  CHECK(board.outputs().brake_duty == 0.0);
  board.advance_to(1000 * ms);
  CHECK(board.outputs().drive_duty == 0.0);
  // The wrong wiring: pulled high is full PWM.
  const auto made_wrong = hm2_board({.active_high_stage = true});
  UdpBoard& wrong = *made_wrong;
  CHECK(wrong.outputs().brake_duty == 1.0);
}

TEST_CASE("Duty = value / 4096, by inverted pins whose source is the generator; the E-stop cuts the drive only") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  activate(board);
  CHECK(board.outputs().brake_duty == 0.0);
  set_brake(board, 2866);
  write32(board, 0x4000, 1024U << 16U);
  CHECK(board.outputs().brake_duty == 2866.0 / 4096.0);
  CHECK(board.outputs().drive_duty == 0.25);
  board.press_emergency_stop(true);
  CHECK(board.outputs().drive_duty == 0.0);
  CHECK(board.outputs().brake_duty == 2866.0 / 4096.0);
  // Values cannot be read back; levels of pins can.
  CHECK(read32(board, 0x4004) == 0);
  // Without inversion a pin that is high for 0.7 of the time is low for 0.3 of it.
  write32(board, 0x1404, 0);
  CHECK_THAT(board.outputs().brake_duty, WithinAbs(1.0 - 2866.0 / 4096.0, 1e-12));
  // Without the alternate source the pin has the level of the output register.
  write32(board, 0x1204, 0);
  CHECK(board.outputs().brake_duty == 1.0);
  write32(board, 0x1004, 2);
  CHECK(board.outputs().brake_duty == 0.0);
  // The enable register of the generators has no pin in G540x2 and stops nothing.
  write32(board, 0x1404, 2);
  write32(board, 0x1204, 2);
  write32(board, 0x4400, 0);
  CHECK(board.outputs().brake_duty == 2866.0 / 4096.0);
}

TEST_CASE("A pin's level, sampled over periods, has the duty and the frequency of ClockHigh rate / 65536 / 4096") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  activate(board);
  set_brake(board, 1000);
  write32(board, 0x0C00, 0x7FFFFFFF);
  int high = 0;
  int rises = 0;
  bool before = false;
  constexpr int samples = 200'000;  // 2 s, every 10 us
  for (int n = 1; n <= samples; ++n) {
    board.advance_to(n * std::int64_t{10'000});
    const bool now = (read32(board, 0x1004) & 2U) != 0;
    high += now ? 1 : 0;
    rises += now && !before ? 1 : 0;
    before = now;
  }
  CHECK_THAT(static_cast<double>(high) / samples, WithinAbs(1.0 - 1000.0 / 4096.0, 2e-3));
  CHECK_THAT(rises / 2.0, WithinAbs(200e6 * 214.0 / 65536.0 / 4096.0, 0.6));
}

TEST_CASE("The watchdog bites N + 3 or 4 clocks after the load; a bite clears DDR and open drain, nothing else") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  activate(board);
  write32(board, 0x1300, 0x10);
  set_brake(board, 2000);
  board.advance_to(3 * ms);
  pet(board);
  board.advance_to(3 * ms + 4'999'990 + 30);
  CHECK(board.outputs().brake_duty > 0.4);
  CHECK(read32(board, 0x0D00) == 0);
  board.advance_to(3 * ms + 4'999'990 + 40);
  CHECK(board.outputs().brake_duty == 0.0);
  CHECK(read32(board, 0x0D00) == 1);
  CHECK(read32(board, 0x1100) == 0);
  CHECK(read32(board, 0x1104) == 0);
  CHECK_THAT(board.registers_text(), Contains("1300=00000000") && Contains("4004=07d00000"));
  const auto events = board.log().take_events();
  REQUIRE(events.size() >= 2);
  CHECK(events.back().text == "outputs zero: watchdog; watchdog last reloaded 5.000 ms ago");
  CHECK(events.back().time_ns == 8'000'030);
  // A reload arms it again, but the status stays, and nothing forbids the next DDR write: the old duty is back.
  pet(board);
  CHECK(read32(board, 0x0D00) == 1);
  write32(board, 0x1104, 2);
  CHECK(board.outputs().brake_duty == 2000.0 / 4096.0);
  write32(board, 0x0D00, 1);
  CHECK(read32(board, 0x0D00) == 1);
  write32(board, 0x0D00, 0);
  CHECK(read32(board, 0x0D00) == 0);
  board.advance_to(20 * ms);
  CHECK(read32(board, 0x0D00) == 1);
}

TEST_CASE("Only the mark 5A reloads; switching the armed watchdog off, or loading 1, bites at once") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  activate(board);
  set_brake(board, 2000);
  board.advance_to(4 * ms);
  write32(board, 0x0E00, 0x5B000000);
  board.advance_to(6 * ms);
  CHECK(board.outputs().brake_duty == 0.0);
  activate(board);
  set_brake(board, 2000);
  write32(board, 0x0C00, 0x80000000);
  CHECK(board.outputs().brake_duty == 0.0);
  CHECK(read32(board, 0x0D00) == 1);
  activate(board);
  set_brake(board, 2000);
  CHECK(ask(board, "81C2000C01000000").empty());
  board.advance_to(6 * ms + 50);
  CHECK(board.outputs().brake_duty == 0.0);
  // Loaded while it is off, the off value bites nothing.
  activate(board);
  board.advance_to(20 * ms);
  write32(board, 0x0D00, 0);
  write32(board, 0x0C00, 0x80000000);
  CHECK(read32(board, 0x0D00) == 0);
}

TEST_CASE("Double buffering delays a value to the next period of 160 Hz; without it the value acts at once") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  activate(board, 0x23);
  write32(board, 0x0C00, 0x7FFFFFFF);
  const double period_ns = 1e9 * 65536.0 * 4096.0 / 200e6 / 214.0;
  board.advance_to(static_cast<std::int64_t>(2.5 * period_ns));
  set_brake(board, 2048);
  board.advance_to(static_cast<std::int64_t>(3.0 * period_ns) - 1000);
  CHECK(board.outputs().brake_duty == 0.0);
  board.advance_to(static_cast<std::int64_t>(3.0 * period_ns) + 1000);
  CHECK(board.outputs().brake_duty == 0.5);
  write32(board, 0x4104, 3);
  set_brake(board, 1024);
  CHECK(board.outputs().brake_duty == 0.25);
}

TEST_CASE("Counts wrap at 16 bits and are the encoder's; count and stamps give the speed to a part in 1000") {
  constexpr double speed = 100.0;
  const auto made_board = hm2_board({.start_speed_rad_s = speed});
  UdpBoard& board = *made_board;
  write32(board, 0x3200, 48);
  const auto sample = [&board] { return ask(board, "814200338242003082420031"); };
  board.advance_to(1 * ms);
  Bytes before = sample();
  std::int64_t counts = 0;
  std::int64_t stamps = 0;
  const double angle0 = board.plant().state().angle2_rad;
  constexpr int cycles = 1200;
  for (int n = 0; n < cycles; ++n) {
    board.advance_to((n + 2) * ms);
    const Bytes now = sample();
    counts += static_cast<std::int16_t>(number(now, 4, 2) - number(before, 4, 2));
    stamps += static_cast<std::uint16_t>(number(now, 6, 2) - number(before, 6, 2));
    // The stamp is of the past: less than the time of a count before the time-stamp counter.
    const auto age = static_cast<std::uint16_t>(number(now, 0, 2) - number(now, 6, 2));
    CHECK(age <= 2e6 * 2.0 * M_PI / 4096.0 / 60.0 + 1.0);
    before = now;
  }
  const double turned = board.plant().state().angle2_rad - angle0;
  CHECK(std::abs(static_cast<double>(counts) - turned * 4096.0 / 2.0 / M_PI) <= 1.0);
  CHECK(std::abs(counts) > 65536);  // it has wrapped
  const double from_stamps = static_cast<double>(counts) * 2.0 * M_PI / 4096.0 / (static_cast<double>(stamps) / 2e6);
  CHECK_THAT(from_stamps, WithinRel(turned / (cycles * 1e-3), 1e-3));
}

TEST_CASE("Hand-turned wheels count backwards; a write clears a counter; the error bit latches") {
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
  board.turn_by_hand(true, -0.5);
  CHECK((read32(board, 0x3004) & 0xFFFF) == 0x10000 - 2048);
  CHECK((read32(board, 0x3000) & 0xFFFF) == 0);
  write32(board, 0x3004, 0);
  CHECK((read32(board, 0x3004) & 0xFFFF) == 0);
  write32(board, 0x3104, 0x0800);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x0800);
  board.make_quadrature_error(true);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x8800);
  write32(board, 0x3104, 0x8800);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x8800);
  write32(board, 0x3104, 0x0800);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x0800);
  CHECK((read32(board, 0x3100) & 0xFFF8) == 0);
  // One count more changes one of the lines A and B.
  const unsigned lines = read32(board, 0x3104) & 3U;
  board.turn_by_hand(true, 1.0 / 4096.0);
  const unsigned changed = lines ^ (read32(board, 0x3104) & 3U);
  CHECK((changed == 1 || changed == 2));
}

TEST_CASE("A power cycle and a reset leave every register as at power-on; the wheels turn on") {
  for (const bool by_network : {false, true}) {
    const auto made_board = hm2_board({.start_speed_rad_s = 50.0});
    UdpBoard& board = *made_board;
    const std::string fresh = board.registers_text();
    activate(board);
    set_brake(board, 2000);
    board.advance_to(100 * ms);
    by_network ? static_cast<void>(ask(board, "81D91C000100")) : board.power_cycle();
    CHECK(board.registers_text() == fresh);
    CHECK(board.outputs().brake_duty == 0.0);
    CHECK(number(ask(board, "01510000"), 0, 2) == 0);
    CHECK((read32(board, 0x3000) & 0xFFFF) == 0);
    CHECK(board.plant().state().omega2_rad_s > 10.0);
  }
}

// The emulated 7I92T, by datagrams laid out by hand from the facts and by the recording of LinuxCNC: no line shared
// with the driver.

#include "emulator/hm2_board.hpp"

#include <cmath>
#include <fstream>
#include <random>
#include <sstream>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::emulator;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr std::int64_t ms = 1'000'000;

Bytes hex(std::string text) {
  std::erase(text, ' ');
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

std::uint64_t number(const Bytes& bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = count; i > 0; --i) value = value << 8U | bytes.at(at + i - 1);
  return value;
}

Bytes ask(Hm2Board& board, const std::string& text) { return board.answer(hex(text)); }

std::uint32_t read32(Hm2Board& board, unsigned address) {
  const Bytes answer =
      board.answer(Bytes{0x81, 0x42, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8U)});
  REQUIRE(answer.size() == 4);
  return static_cast<std::uint32_t>(number(answer, 0, 4));
}

void write32(Hm2Board& board, unsigned address, std::uint32_t value) {
  Bytes datagram{0x81, 0xC2, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8U)};
  for (int i = 0; i < 4; ++i) datagram.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  CHECK(board.answer(datagram).empty());
}

/// As a driver activates: values 0, mode, rate of 160 Hz, inversion, PWM pins, watchdog of 5 ms, DDR last.
void activate(Hm2Board& board, std::uint32_t mode = 3) {
  for (const unsigned i : {0U, 4U}) {
    write32(board, 0x4000 + i, 0);
    write32(board, 0x4100 + i, mode);
    write32(board, 0x1400 + i, 2);
    write32(board, 0x1200 + i, 2);
  }
  write32(board, 0x4200, 0xD6);
  write32(board, 0x0C00, 499'999);
  write32(board, 0x0D00, 0);
  for (const unsigned i : {0U, 4U}) write32(board, 0x1100 + i, 2);
}

void pet(Hm2Board& board) { write32(board, 0x0E00, 0x5A000000); }
void set_brake(Hm2Board& board, std::uint32_t steps) { write32(board, 0x4004, steps << 16U); }

}  // namespace

TEST_CASE("After power-on the watchdog has bitten, no pin is driven, all are pulled high") {
  Hm2Board board({});
  CHECK(read32(board, 0x0D00) == 1);
  CHECK(read32(board, 0x0C00) == 0x80000000);
  CHECK(read32(board, 0x1100) == 0);
  CHECK((read32(board, 0x1000) & 0x1FFF) == 0x1FFF);
  CHECK(board.outputs().brake_duty == 0.0);
  board.advance_to(1000 * ms);
  CHECK(board.outputs().drive_duty == 0.0);
  // The wrong wiring: pulled high is full PWM.
  Hm2Board wrong({.active_high_stage = true});
  CHECK(wrong.outputs().brake_duty == 1.0);
}

TEST_CASE("Duty = value / 4096, by inverted pins whose source is the generator; the E-stop cuts the drive only") {
  Hm2Board board({});
  activate(board);
  CHECK(board.outputs().brake_duty == 0.0);
  set_brake(board, 2866);
  write32(board, 0x4000, 1024U << 16U);
  CHECK(board.outputs().brake_duty == 2866.0 / 4096.0);
  CHECK(board.outputs().drive_duty == 0.25);
  board.fpga().press_emergency_stop(true);
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
  Hm2Board board({});
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
  Hm2Board board({});
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
  CHECK_THAT(board.fpga().registers_text(), Contains("1300=00000000") && Contains("4004=07d00000"));
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
  Hm2Board board({});
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
  Hm2Board board({});
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
  Hm2Board board({.start_speed_rad_s = speed});
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
  Hm2Board board({});
  board.fpga().turn_by_hand(true, -0.5);
  CHECK((read32(board, 0x3004) & 0xFFFF) == 0x10000 - 2048);
  CHECK((read32(board, 0x3000) & 0xFFFF) == 0);
  write32(board, 0x3004, 0);
  CHECK((read32(board, 0x3004) & 0xFFFF) == 0);
  write32(board, 0x3104, 0x0800);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x0800);
  board.fpga().make_quadrature_error(true);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x8800);
  write32(board, 0x3104, 0x8800);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x8800);
  write32(board, 0x3104, 0x0800);
  CHECK((read32(board, 0x3104) & 0xFFF8) == 0x0800);
  CHECK((read32(board, 0x3100) & 0xFFF8) == 0);
  // One count more changes one of the lines A and B.
  const unsigned lines = read32(board, 0x3104) & 3U;
  board.fpga().turn_by_hand(true, 1.0 / 4096.0);
  const unsigned changed = lines ^ (read32(board, 0x3104) & 3U);
  CHECK((changed == 1 || changed == 2));
}

TEST_CASE("Spaces: name, versions, MAC, address, clock, scratch, packet counts, info areas, pointers") {
  Hm2Board board({.name = "7I92", .mac = {0, 0x60, 0x1B, 1, 2, 3}, .address = {10, 10, 10, 10}});
  CHECK(ask(board, "885D0000") == hex("37493932000000000000000000000000"));
  CHECK(ask(board, "835D1000") == hex("030011000000"));
  CHECK(ask(board, "83490200") == hex("0302011b6000"));
  CHECK(ask(board, "82492000") == hex("0a0a0a0a"));
  board.advance_to(70'001'999);
  CHECK(number(ask(board, "01510000"), 0, 2) == 70'001 - 65'536);
  CHECK(ask(board, "82D114002A000000").empty());
  CHECK(ask(board, "84511000") == hex("000000002a000000"));
  CHECK(number(ask(board, "01590800"), 0, 2) == 8);
  CHECK(number(ask(board, "01590E00"), 0, 2) == 7);  // without the one of this answer
  CHECK(ask(board, "01610000 016D0000 017D0000") == hex("005a 035a 075a"));
  CHECK(ask(board, "84610800") == Bytes({'H', 'o', 's', 't', 'M', 'o', 't', '2'}));
  // A pointer stays after the last unit; without increment it stays where it was.
  CHECK(ask(board, "81420001") == hex("fecaaa55"));
  CHECK(ask(board, "8202") == Bytes({'H', 'O', 'S', 'T', 'M', 'O', 'T', '2'}));
  CHECK(ask(board, "0142000181028102") == hex("fecaaa55 fecaaa55 484f5354"));
}

TEST_CASE(
    "Commands that no space takes count as errors and read as zeros; broken datagrams are obeyed up to the break") {
  Hm2Board board({});
  CHECK(ask(board, "81410001") == hex("0000"));              // HostMot2 by 16 bits
  CHECK(ask(board, "84550000") == hex("0000000000000000"));  // space 5
  CHECK(ask(board, "81DD0000FFFF").empty());                 // the name is read-only
  CHECK(ask(board, "81C920000102").empty());                 // the EEPROM is locked
  CHECK(ask(board, "8142000181C2000E0000").size() == 4);     // a write without all of its data
  CHECK(ask(board, "81").empty());
  CHECK(ask(board, "84590000") == hex("0700 0200 0200 0200"));
  CHECK(ask(board, "82492000") == hex("7901a8c0"));
  // The key opens the EEPROM for one write.
  CHECK(ask(board, "81D91A00025A 81C920000102 81C922000304").empty());
  CHECK(ask(board, "82492000") == hex("0102a8c0"));
  // An answer ends where the next one would not fit into a packet.
  Bytes many;
  for (int n = 0; n < 64; ++n) {
    for (const std::uint8_t byte : hex("FF420001")) many.push_back(byte);
  }
  CHECK(board.answer(many).size() == 2 * 127 * 4);
}

TEST_CASE("A power cycle and a reset leave every register as at power-on; the wheels turn on") {
  for (const bool by_network : {false, true}) {
    Hm2Board board({.start_speed_rad_s = 50.0});
    const std::string fresh = board.fpga().registers_text();
    activate(board);
    set_brake(board, 2000);
    board.advance_to(100 * ms);
    by_network ? static_cast<void>(ask(board, "81D91C000100")) : board.power_cycle();
    CHECK(board.fpga().registers_text() == fresh);
    CHECK(board.outputs().brake_duty == 0.0);
    CHECK(number(ask(board, "01510000"), 0, 2) == 0);
    CHECK((read32(board, 0x3000) & 0xFFFF) == 0);
    CHECK(board.plant().state().omega2_rad_s > 10.0);
  }
}

TEST_CASE("In lock-step only a write of all of space 5 advances the time") {
  Hm2Board board({.lock_step = true});
  CHECK(ask(board, "82D6000040420F0000000000").empty());
  CHECK(board.time_ns() == 1 * ms);
  CHECK(number(ask(board, "82560000"), 0, 8) == 1'000'000);
  CHECK(ask(board, "81D6000080841E00").empty());
  CHECK(board.time_ns() == 1 * ms);
  CHECK(ask(board, "81D6040000000000").empty());
  CHECK(board.time_ns() == 2 * ms);
  CHECK(board.writes() == 0);
}

TEST_CASE("Each lie changes what the board says about itself; an unknown one is refused with all known ones") {
  const auto says = [](Hm2Board& board) {
    Bytes all;
    for (const char* const part : {"FF420001", "FF42FC02", "FF42F804", "825D1000"}) {
      const Bytes answer = ask(board, part);
      all.insert(all.end(), answer.begin(), answer.end());
    }
    return all;
  };
  Hm2Board truthful({});
  std::istringstream names(Hm2Identity::lies());
  std::vector<Bytes> told{says(truthful)};
  for (std::string name; names >> name;) {
    INFO(name);
    Hm2Board liar({.lie = name});
    CHECK(std::find(told.begin(), told.end(), says(liar)) == told.end());
    told.push_back(says(liar));
  }
  CHECK(told.size() == 23);
  CHECK_THROWS_WITH(Hm2Board({.lie = "honest"}), Contains("honest") && Contains("255-instances"));
  CHECK_THROWS_WITH(Hm2Board({.name = ""}), Contains("1 to 16 characters"));
  CHECK_THROWS_WITH(Hm2Board({.drive_pwm = 1}), Contains("PWM generators 1 and 1"));
  CHECK_THROWS_WITH(Hm2Board({.enable_pin = 34}), Contains("-1 to 33"));
}

TEST_CASE("Any datagram is answered within a packet, and two boards answer the same") {
  Hm2Board one({});
  Hm2Board two({});
  std::mt19937 random(7);
  for (int n = 0; n < 50'000; ++n) {
    Bytes datagram(random() % 60);
    for (std::uint8_t& byte : datagram) byte = static_cast<std::uint8_t>(random());
    one.advance_to(n * std::int64_t{20'000});
    two.advance_to(n * std::int64_t{20'000});
    const Bytes answer = one.answer(datagram);
    if (answer.size() > Hm2Board::largest_answer || answer != two.answer(datagram)) FAIL("datagram " << n);
  }
  CHECK(one.fpga().registers_text() == two.fpga().registers_text());
}

TEST_CASE("LinuxCNC's recorded datagrams get the recorded answers, but for levels, counts and times") {
  // Recorded with another emulator of a 7I92, whose wheels, clock and open pins were other ones.
  std::ifstream file(ABS_HIL_HM2_FRAMES);
  REQUIRE(file);
  Hm2Board board({.name = "7I92", .mac = {0, 0, 0x1B, 0x60, 0x3B, 0x10}});
  int compared = 0;
  double last_write_s = 0.0;
  std::uint64_t packets_left_out = 0;  // of the recording, where it says "..."
  bool after_gap = false;
  Bytes answer;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    double time_s = 0.0;
    std::string direction;
    std::size_t size = 0;
    std::string text;
    if (!(words >> time_s >> direction >> size >> text)) {
      after_gap = true;
      answer.clear();
      continue;
    }
    INFO(line);
    const Bytes frame = hex(text);
    REQUIRE(frame.size() == size);
    if (direction == "RX") {
      board.advance_to(static_cast<std::int64_t>(time_s * 1e9));
      answer = board.answer(frame);
      if (size >= 40) last_write_s = time_s;
      continue;
    }
    if (answer.empty()) continue;  // its request is among those left out
    ++compared;
    if (size != 42) {
      CHECK(answer == frame);
      continue;
    }
    REQUIRE(answer.size() == frame.size());
    // Status of the watchdog of 5 ms: not judged where the clocks of the two emulators may disagree.
    if (std::abs(time_s - last_write_s - 0.005) > 0.001) CHECK(number(answer, 8, 4) == number(frame, 8, 4));
    CHECK(number(answer, 14, 2) == 0);  // the time-stamp counter has 16 bits
    for (const std::size_t control : {24U, 28U}) {
      CHECK((number(answer, control, 4) & ~7U) == (number(frame, control, 4) & ~7U));
    }
    if (after_gap) packets_left_out = number(frame, 32, 2) - number(answer, 32, 2);
    CHECK(number(answer, 32, 2) + packets_left_out == number(frame, 32, 2));
    CHECK(number(answer, 34, 4) == number(frame, 34, 4));
    if (!after_gap) CHECK(number(answer, 38, 4) == number(frame, 38, 4));
    after_gap = false;
  }
  CHECK(compared == 168);
}

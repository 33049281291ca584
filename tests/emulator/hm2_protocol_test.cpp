// The protocol of the emulated 7I92T: spaces, commands, time, other descriptions, and the recording of LinuxCNC.

#include <cmath>
#include <fstream>
#include <functional>
#include <numeric>
#include <random>
#include <sstream>

#include "hm2_datagrams.hpp"

using namespace abs_hil;
using namespace abs_hil::emulator;
using namespace abs_hil::test;
using Catch::Matchers::Contains;

TEST_CASE("Spaces: name, versions, MAC, address, clock, scratch, packet counts, info areas, pointers") {
  const auto made_board = hm2_board({.name = "7I92", .mac = {0, 0x60, 0x1B, 1, 2, 3}, .address = {10, 10, 10, 10}});
  UdpBoard& board = *made_board;
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
  const auto made_board = hm2_board({});
  UdpBoard& board = *made_board;
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

TEST_CASE("An emulator carries its mark in space 5, in lock-step with the sizes that the space takes") {
  CHECK(ask(*hm2_board({}), "82750000") == hex("055A 0000"));
  CHECK(ask(*hm2_board({.lock_step = true}), "82750000") == hex("055A 0F81"));
}

TEST_CASE("In lock-step only a write of all of space 5 advances the time") {
  const auto made_board = hm2_board({.lock_step = true});
  UdpBoard& board = *made_board;
  CHECK(ask(board, "82D6000040420F0000000000").empty());
  CHECK(board.time_ns() == 1 * ms);
  CHECK(number(ask(board, "82560000"), 0, 8) == 1'000'000);
  CHECK(ask(board, "81D6000080841E00").empty());
  CHECK(board.time_ns() == 1 * ms);
  CHECK(ask(board, "81D6040000000000").empty());
  CHECK(board.time_ns() == 2 * ms);
  CHECK(board.writes() == 0);
}

TEST_CASE("Another word of its description is what the board says, and nothing else of it changes") {
  const auto says = [](UdpBoard& board) {
    Bytes all;
    for (const char* const part : {"FF420001", "FF42FC02", "FF42F804", "825D1000"}) {
      const Bytes answer = ask(board, part);
      all.insert(all.end(), answer.begin(), answer.end());
    }
    return all;
  };
  const auto truthful = hm2_board({});
  const auto other = hm2_board({.words = {{0x458, 0x01010204}}});
  Bytes told = says(*truthful);
  const Bytes changed = says(*other);
  CHECK(std::inner_product(told.begin(), told.end(), changed.begin(), 0, std::plus<>(), std::not_equal_to<>()) == 1);
  CHECK(ask(*other, "81425804") == Bytes{0x04, 0x02, 0x01, 0x01});
  CHECK_THROWS_WITH(hm2_board({.name = ""}), Contains("1 to 16 characters"));
  CHECK_THROWS_WITH(hm2_board({.enable_line = 34}), Contains("-1 to 33"));
}

TEST_CASE("Any datagram is answered within a packet, and two boards answer the same") {
  const auto made_one = hm2_board({});
  UdpBoard& one = *made_one;
  const auto made_two = hm2_board({});
  UdpBoard& two = *made_two;
  std::mt19937 random(7);
  for (int n = 0; n < 50'000; ++n) {
    Bytes datagram(random() % 60);
    for (std::uint8_t& byte : datagram) byte = static_cast<std::uint8_t>(random());
    one.advance_to(n * std::int64_t{20'000});
    two.advance_to(n * std::int64_t{20'000});
    const Bytes answer = one.answer(datagram);
    if (answer.size() > largest_hm2_answer || answer != two.answer(datagram)) FAIL("datagram " << n);
  }
  CHECK(one.registers_text() == two.registers_text());
}

TEST_CASE("LinuxCNC's recorded datagrams get the recorded answers, but for levels, counts and times") {
  // Recorded with another emulator of a 7I92, whose wheels, clock and open pins were other ones.
  std::ifstream file(ABS_HIL_HM2_FRAMES);
  REQUIRE(file);
  const auto made_board = hm2_board({.name = "7I92", .mac = {0, 0, 0x1B, 0x60, 0x3B, 0x10}});
  UdpBoard& board = *made_board;
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

// Frames that LinuxCNC's hm2_eth exchanged with an emulator of a 7I92 that is not this project's
// (tests/emulator/hm2_frames.txt): this driver's wire makes the same requests, understands every answer, and its first
// set-up leaves the same registers, except for those that docs/hm2.md names.

#include <fstream>
#include <map>
#include <sstream>

#include "catch.hpp"
#include "register_board.hpp"

using namespace abs_hil;
using namespace abs_hil::test;
using driver::hm2::CycleAnswer;
using driver::hm2::Hm2Driver;
using driver::hm2::Packet;

namespace {

using Bytes = RegisterBoard::Bytes;

struct Frame {
  bool to_board{false};
  Bytes bytes{};
};

std::vector<Frame> frames() {
  std::vector<Frame> all;
  std::ifstream file(ABS_HIL_HM2_FRAMES);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    double time = 0.0;
    std::string direction;
    std::size_t size = 0;
    std::string hex;
    if (!(words >> time >> direction >> size >> hex)) continue;
    Frame frame{.to_board = direction == "RX"};
    for (std::size_t i = 0; i < hex.size(); i += 2) {
      frame.bytes.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
    }
    REQUIRE(frame.bytes.size() == size);
    all.push_back(std::move(frame));
  }
  REQUIRE(all.size() > 400);
  return all;
}

Bytes bytes_of(const Packet& packet) { return {packet.bytes().begin(), packet.bytes().end()}; }

/// The registers of HostMot2 after all writes up to the last long one, the set-up.
std::map<std::uint16_t, std::uint32_t> registers_of_linuxcnc() {
  RegisterBoard board;
  std::map<std::uint16_t, std::uint32_t> registers;
  for (const Frame& frame : frames()) {
    if (!frame.to_board) continue;
    board.handle(frame.bytes);
    if (frame.bytes.size() > 100) registers = board.written;
  }
  return registers;
}

constexpr driver::hm2::CycleWire stock{.ports = 2,
                                       .port_data = 0x1000,
                                       .direction = 0x1100,
                                       .bitten = 0x0D00,
                                       .pet = 0x0E00,
                                       .stamp_clock = 0x3300,
                                       .count = {0x3000, 0x3004},
                                       .control = {0x3100, 0x3104},
                                       .pwm = {0x4000, 0x4004}};

}  // namespace

TEST_CASE("The wire makes LinuxCNC's requests, byte for byte") {
  std::size_t reads = 0;
  std::size_t writes = 0;
  for (const Frame& frame : frames()) {
    if (!frame.to_board) continue;
    if (frame.bytes.size() == 36) {
      Packet packet;
      packet.read(driver::hm2::space::hostmot2, 0x1000, 2);
      packet.read(driver::hm2::space::hostmot2, 0x0D00);
      packet.read(driver::hm2::space::hostmot2, 0x3300);
      packet.read(driver::hm2::space::hostmot2, 0x3000, 2);
      packet.read(driver::hm2::space::hostmot2, 0x3100, 2);
      packet.read(driver::hm2::space::status, 0x08);
      packet.write_number(0x10, driver::hm2::word32(frame.bytes, 28));
      packet.read(driver::hm2::space::timers, 0x10, 4);
      CHECK(bytes_of(packet) == frame.bytes);
      CHECK(packet.answer_bytes() == 42);
      ++reads;
    } else if (frame.bytes.size() == 40 && frame.bytes[19] == 0x5A) {
      const Packet packet =
          stock.write({}, {driver::hm2::word32(frame.bytes, 24), driver::hm2::word32(frame.bytes, 28)},
                      driver::hm2::word32(frame.bytes, 36));
      CHECK(bytes_of(packet) == frame.bytes);
      ++writes;
    }
  }
  CHECK(reads > 100);
  CHECK(writes > 100);
}

TEST_CASE("Every recorded answer of a cycle is understood") {
  std::size_t understood = 0;
  for (const Frame& frame : frames()) {
    if (frame.to_board || frame.bytes.size() != 42) continue;
    // LinuxCNC asks for neither the clock nor the direction, and for one count of packets.
    const Bytes clock{0x34, 0x12};
    const Bytes direction{2, 0, 0, 0, 2, 0, 0, 0};
    const Bytes datagrams{0x78, 0x56};
    const std::span<const std::uint8_t> recorded(frame.bytes);
    Bytes answer;
    for (const std::span<const std::uint8_t> part :
         {std::span(clock), recorded.first(8), std::span(direction), recorded.subspan(8, 26), std::span(datagrams),
          recorded.subspan(34)}) {
      answer.insert(answer.end(), part.begin(), part.end());
    }
    CycleAnswer got;
    REQUIRE(stock.decode(answer, got));
    CHECK(got.clock_us == 0x1234);
    CHECK(got.direction[1] == 2);
    CHECK(got.bitten == driver::hm2::word32(frame.bytes, 8));
    CHECK(got.count[1] == driver::hm2::word32(frame.bytes, 20));
    CHECK(got.received.all == driver::hm2::word16(frame.bytes, 32));
    CHECK(got.received.udp == 0x5678);
    CHECK(got.write_number == driver::hm2::word32(frame.bytes, 38));
    answer.pop_back();
    CHECK_FALSE(stock.decode(answer, got));
    ++understood;
  }
  CHECK(understood > 100);
}

TEST_CASE("The recorded board is read as the 7I92 that it is") {
  // The recording as an image: what each address answered.
  RegisterBoard board;
  board.rom.clear();
  const auto all = frames();
  for (std::size_t i = 0; i + 1 < all.size(); ++i) {
    const Bytes& request = all[i].bytes;
    if (!all[i].to_board || request.size() != 4 || request[1] % 0x40 != 2) continue;
    const Bytes& answer = all[i + 1].bytes;
    std::uint16_t address = static_cast<std::uint16_t>(request[2] | request[3] << 8U);
    for (std::size_t at = 0; at + 4 <= answer.size(); at += 4, address += 4) {
      board.rom[address] = driver::hm2::word32(answer, at);
    }
  }
  REQUIRE(board.rom.size() > 50);
  Cable cable(board);
  Hm2Driver driver({}, cable.opener());
  driver.configure();
  CHECK(driver.board().idrom_name == "MESA7I92");
  CHECK(driver.board().clock_low_Hz == 100e6);
  CHECK(driver.board().clock_high_Hz == 200e6);
  CHECK(driver.board().ports == 2);
  CHECK(driver.board().port_width == 17);
  CHECK(driver.board().counter.instances == 2);
  CHECK(driver.board().pwm.instances == 2);
  CHECK(driver.board().modules.size() == 5);
  CHECK(driver.identity().place == "00:00:1b:60:3b:10");
}

TEST_CASE("The first set-up leaves LinuxCNC's registers, except for those of docs/hm2.md") {
  RegisterBoard board;
  Cable cable(board);
  Hm2Driver driver({.watchdog_ms = 5}, cable.opener());
  driver.configure();
  driver.activate(0);
  std::map<std::uint16_t, std::uint32_t> ours = board.written;
  std::map<std::uint16_t, std::uint32_t> theirs = registers_of_linuxcnc();
  // Each difference, with the two values.
  const auto differs = [&](std::uint16_t address, std::uint32_t own, std::uint32_t other) {
    CAPTURE(address);
    CHECK(ours[address] == own);
    CHECK(theirs[address] == other);
    ours.erase(address);
    theirs.erase(address);
  };
  differs(0x1400, 0x2, 0x0);  // outputs inverted: the stage is active-low
  differs(0x1404, 0x2, 0x0);
  differs(0x4100, 0x03, 0x23);  // not double-buffered: a new duty acts at once
  differs(0x4104, 0x03, 0x23);
  differs(0x4000, 0x0, 0x0B320000);  // duty 0 first
  differs(0x4004, 0x0, 0x03FF0000);
  theirs.erase(0x4300);  // pulse density is not used
  theirs.erase(0x0000);  // no register: the board ignores it
  CHECK(ours == theirs);
}

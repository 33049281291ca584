#pragma once

// Datagrams to the emulated 7I92T, laid out by hand from the facts: no line shared with the driver.

#include <cstdint>
#include <string>
#include <vector>

#include "catch.hpp"
#include "emulator/udp_board.hpp"

namespace abs_hil::test {

using emulator::UdpBoard;
using Bytes = std::vector<std::uint8_t>;
inline constexpr std::int64_t ms = 1'000'000;

inline Bytes hex(std::string text) {
  std::erase(text, ' ');
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

inline std::uint64_t number(const Bytes& bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = count; i > 0; --i) value = value << 8U | bytes.at(at + i - 1);
  return value;
}

inline Bytes ask(UdpBoard& board, const std::string& text) { return board.answer(hex(text)); }

inline std::uint32_t read32(UdpBoard& board, unsigned address) {
  const Bytes answer =
      board.answer(Bytes{0x81, 0x42, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8U)});
  REQUIRE(answer.size() == 4);
  return static_cast<std::uint32_t>(number(answer, 0, 4));
}

inline void write32(UdpBoard& board, unsigned address, std::uint32_t value) {
  Bytes datagram{0x81, 0xC2, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8U)};
  for (int i = 0; i < 4; ++i) datagram.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  CHECK(board.answer(datagram).empty());
}

/// As a driver activates: values 0, mode, rate of 160 Hz, inversion, PWM pins, watchdog of 5 ms, DDR last.
inline void activate(UdpBoard& board, std::uint32_t mode = 3) {
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

inline void pet(UdpBoard& board) { write32(board, 0x0E00, 0x5A000000); }
inline void set_brake(UdpBoard& board, std::uint32_t steps) { write32(board, 0x4004, steps << 16U); }

}  // namespace abs_hil::test

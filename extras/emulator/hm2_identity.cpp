// What a 7I92 with firmware G540x2 says about itself.

#include <algorithm>
#include <cstring>

#include "emulator/udp_board.hpp"

namespace abs_hil::emulator {

namespace {

constexpr std::uint32_t idrom = 0x400;
constexpr std::uint32_t modules = 0x440;
constexpr std::uint32_t pins = 0x600;
constexpr std::uint32_t pin_count = 34;

/// Module descriptors in the order of the recording with LinuxCNC: watchdog, I/O ports, counters, PWM, LEDs.
constexpr std::array<std::uint32_t, 15> module_table{
    0x01010002, 0x00030C00, 0x00,   // watchdog: 1 instance on ClockLow, 3 registers at 0C00
    0x02010003, 0x00051000, 0x1F,   // I/O ports: 2 instances, 5 registers at 1000, all of them per port
    0x02010204, 0x00053000, 0x03,   // counters: version 2, 2 instances, count and control per counter
    0x02020006, 0x00054000, 0x03,   // PWM on ClockHigh: 2 instances, value and mode per generator
    0x01010080, 0x00010200, 0x00};  // LEDs

constexpr std::uint32_t pin(std::uint32_t number, std::uint32_t tag, std::uint32_t unit) {
  return 0x03000000U | unit << 16U | tag << 8U | number;
}

std::vector<std::uint32_t> stock_words() {
  std::vector<std::uint32_t> words(pins / 4 + 512 / 4, 0);
  words[0x100 / 4] = 0x55AACAFE;
  std::memcpy(&words[0x104 / 4], "HOSTMOT2", 8);
  words[0x10C / 4] = idrom;
  const std::array<std::uint32_t, 16> header{3,   modules - idrom, pins - idrom, 0,           0,  // its name follows
                                             9,                                                   // size of the FPGA
                                             144,                                                 // its pins
                                             2,   pin_count,       17,           100'000'000, 200'000'000, 4, 64, 256,
                                             4};
  std::copy(header.begin(), header.end(), words.begin() + idrom / 4);
  std::memcpy(&words[idrom / 4 + 3], "MESA7I92", 8);
  std::copy(module_table.begin(), module_table.end(), words.begin() + modules / 4);
  for (std::uint32_t io = 0; io < pin_count; ++io) words[pins / 4 + io] = pin(0, 0, 0);
  for (std::uint32_t unit = 0; unit < 2; ++unit) {
    const std::uint32_t first = pins / 4 + unit * 17;
    words[first + 1] = pin(0x81, 6, unit);
    for (std::uint32_t line = 0; line < 3; ++line) words[first + 13 + line] = pin(line + 1, 4, unit);
  }
  return words;
}

}  // namespace

Hm2Identity::Hm2Identity(const Hm2Words& others) : words(stock_words()) {
  for (const auto& [address, value] : others) words.at(address / 4) = value;
}

}  // namespace abs_hil::emulator

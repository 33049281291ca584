#pragma once

// A node without its chip, for its tests: datagrams laid out by hand, registers by their addresses.

#include <cstdint>
#include <string>
#include <vector>

#include "catch.hpp"
#include "node_core.h"

namespace node_test {

using Bytes = std::vector<std::uint8_t>;

inline Bytes hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] == ' ') {
      ++i;
      continue;
    }
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
    i += 2;
  }
  return bytes;
}

inline const node_identity identity{"abs-node", "ABS-NODE", {0x02, 0xAB, 0x50, 1, 2, 3}, {192, 168, 1, 121}};

/// A node, its clock, and registers by name.
struct Node {
  node_core core{};
  std::uint32_t now_us{0};

  Node() { node_init(&core, &identity); }

  Bytes ask(const Bytes& datagram) {
    constexpr std::uint8_t untouched = 0xA5;
    Bytes answer(NODE_MOST_BYTES + 1, untouched);
    const std::size_t size = node_datagram(&core, now_us, datagram.data(), datagram.size(), answer.data());
    REQUIRE(size <= NODE_MOST_BYTES);
    CHECK((size == 0 || answer[size] == untouched));
    CHECK(answer.back() == untouched);
    answer.resize(size);
    return answer;
  }
  Bytes ask(const std::string& text) { return ask(hex(text)); }
  std::uint32_t read(std::uint32_t address) {
    const Bytes a = ask(Bytes{0x81, 0x42, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8)});
    REQUIRE(a.size() == 4);
    return a[0] | a[1] << 8U | a[2] << 16U | static_cast<std::uint32_t>(a[3]) << 24U;
  }
  std::uint32_t read16(const std::string& command) {
    const Bytes a = ask(command);
    REQUIRE(a.size() == 2);
    return a[0] | static_cast<std::uint32_t>(a[1]) << 8U;
  }
  void write(std::uint32_t address, std::uint32_t value) {
    Bytes d{0x81, 0xC2, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(address >> 8)};
    for (int i = 0; i < 4; ++i) d.push_back(static_cast<std::uint8_t>(value >> 8 * i));
    CHECK(ask(d).empty());
  }
  void poll(std::uint32_t at_us) {
    now_us = at_us;
    node_poll(&core, now_us);
  }
  void feed() { write(0x0E00, 0x5A000000); }
  /// As a driver activates: a bite, values 0, mode of 12 bits, PWM pins, watchdog, status, DDR.
  void activate(std::uint32_t clocks = 499'999) {
    write(0x0C00, 1);
    for (const std::uint32_t i : {0U, 4U}) {
      write(0x4000 + i, 0);
      write(0x4100 + i, 3);
      write(0x1200 + i, 2);
    }
    write(0x4200, 0xD6);
    write(0x0C00, clocks);
    write(0x0D00, 0);
    for (const std::uint32_t i : {0U, 4U}) write(0x1100 + i, 2);
  }
  void set_duty(std::uint32_t channel, std::uint32_t steps) { write(0x4000 + 4 * channel, steps << 16); }
  [[nodiscard]] std::uint32_t duty(unsigned channel) const { return node_duty(&core, channel); }
  [[nodiscard]] bool drives(unsigned channel) const { return node_drives(&core, channel); }
  std::uint32_t errors() { return read16("01590000"); }
};

}  // namespace node_test

// The node without its chip, by datagrams laid out by hand: registers, watchdog, latch, counts, checks of commands.

#include "node_core.h"

#include <cstring>
#include <string>
#include <vector>

#include "catch.hpp"

namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes hex(const std::string& text) {
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

const node_identity identity{"abs-node", "ABS-NODE", {0x02, 0xAB, 0x50, 1, 2, 3}, {192, 168, 1, 121}};

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
    CHECK(answer[size] == untouched);
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

}  // namespace

TEST_CASE("After power-on the node is latched, drives nothing, and no DDR can be set") {
  Node node;
  CHECK(node.read(0x0D00) == 1);
  CHECK(node.read(0x0C00) == 0x80000000);
  node.write(0x1200, 2);
  node.write(0x0C00, 499'999);
  node.write(0x4000, 0x0FFF0000);
  node.write(0x1100, 2);
  node.write(0x1300, 2);
  CHECK(node.read(0x1100) == 0);
  CHECK(node.core.port[3][0] == 0);
  CHECK_FALSE(node.drives(0));
  CHECK(node.duty(0) == 0);
  CHECK(node.errors() == 4);
  CHECK(node.read16("01590600") == 2);  // both writes
  node.write(0x1100, 0);                // 0 may always be written
  CHECK(node.read16("01590600") == 2);
}

TEST_CASE("Activated, each generator's duty is its value; inverted or not, direction backwards or another mode: 0") {
  Node node;
  node.activate();
  CHECK(node.drives(0));
  CHECK(node.drives(1));
  node.set_duty(0, 1024);
  node.set_duty(1, 4095);
  CHECK(node.duty(0) == 1024);
  CHECK(node.duty(1) == 4095);
  CHECK((node.read(0x1000) & 2U) == 0);
  node.write(0x1400, 2);
  CHECK(node.duty(0) == 1024);
  node.write(0x4000, 0x80000000U | 1024U << 16);
  CHECK(node.duty(0) == 0);
  CHECK(node.read(0x1000) == 0x1FFFF);
  node.set_duty(0, 1024);
  CHECK(node.read(0x1000) == 0x1FFFD);
  for (const std::uint32_t outputs : {1U, 2U, 3U}) {  // swapped, up and down, PDM
    node.write(0x4100, 3 | outputs << 3U);
    CHECK(node.duty(0) == 0);
  }
  node.write(0x4100, 0x63);  // double buffered and with dither: as without
  node.write(0x4000, 0x70000000U | 1024U << 16 | 0xFFFF);
  CHECK(node.duty(0) == 1024);
  node.set_duty(0, 1);
  CHECK(node.duty(0) == 1);
  CHECK(node.read(0x1000) == 0x1FFFD);
  node.write(0x4100, 0);  // 9 bits
  node.set_duty(0, 511);
  CHECK(node.duty(0) == 511U * 8U);
  node.write(0x4100, 3);
  // Only a pin with DDR and alternate source is driven.
  node.write(0x1100, 1);
  CHECK_FALSE(node.drives(0));
  node.write(0x1100, 2);
  node.write(0x1200, 1);
  CHECK_FALSE(node.drives(0));
  CHECK(node.duty(0) == 0);
  CHECK(node.duty(1) == 4095);
  CHECK(node.read(0x4004) == 0);
  CHECK(node.read(0x1104) == 2);
  CHECK(node.read(0x1108) == 0);
}

TEST_CASE("The plain output acts while its level would be low, and only while the node is permitted to drive") {
  Node node;
  node.activate();
  node.write(0x1100, 3);
  CHECK(node_output(&node.core));
  node.write(0x1000, 1);
  CHECK_FALSE(node_output(&node.core));
  node.write(0x1400, 1);
  CHECK(node_output(&node.core));
  node.write(0x1100, 2);
  CHECK_FALSE(node_output(&node.core));
  node.write(0x1100, 3);
  node.poll(5000);
  CHECK_FALSE(node_output(&node.core));
}

TEST_CASE("Silence for the armed time: outputs 0, pins inputs, values 0, latched; not a us earlier") {
  for (const std::uint32_t start : {0U, 0xFFFFFFF0U}) {  // also across the clock's wrap
    Node node;
    node.poll(start);
    node.activate();
    node.set_duty(1, 2000);
    node.poll(start + 3000);
    node.feed();
    node.poll(start + 7999);
    CHECK(node.duty(1) == 2000);
    CHECK(node.read(0x0D00) == 0);
    node.poll(start + 8000);
    CHECK(node.duty(1) == 0);
    CHECK_FALSE(node.drives(1));
    CHECK(node.read(0x0D00) == 1);
    CHECK(node.read(0x1100) == 0);
    CHECK(node.read(0x1104) == 0);
    CHECK(node.core.pwm_value[1] == 0);
  }
}

TEST_CASE("The armed time is (value + 1) / 100 MHz, at most 20 ms, and a loop that is late bites before it answers") {
  Node node;
  node.activate(1'000'099);
  node.set_duty(0, 1);
  node.poll(9'999);
  CHECK(node.duty(0) == 1);
  node.feed();
  node.poll(20'000);
  CHECK(node.read(0x0D00) == 1);
  node.activate(0x7FFFFFFF);
  node.set_duty(0, 1);
  node.poll(39'999);
  CHECK(node.duty(0) == 1);
  node.now_us = 40'000;
  CHECK(node.ask("81C2000E0000005A 8142000D") == hex("01000000"));
  CHECK(node.duty(0) == 0);
  CHECK(node.core.allowed_us == 20'000);
}

TEST_CASE("The latch holds: DDR and status do not bring outputs back while a value is not 0") {
  Node node;
  node.activate();
  node.set_duty(0, 1000);
  node.poll(6'000);
  CHECK(node.read(0x0D00) == 1);
  node.set_duty(0, 1000);
  node.write(0x1100, 2);
  CHECK(node.duty(0) == 0);
  CHECK(node.read16("01590600") == 1);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 1);
  CHECK(node.errors() == 4);
  CHECK(node.read16("01590600") == 2);
  node.write(0x0D00, 1);
  CHECK(node.read(0x0D00) == 1);
  node.set_duty(0, 0);
  node.set_duty(1, 1);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 1);
  node.set_duty(1, 0);
  for (const std::uint32_t other : {1U, 2U, 0x100U, 0x80000000U}) node.write(0x0D00, other);  // only 0 opens it
  CHECK(node.read(0x0D00) == 1);
  CHECK(node.read16("01590600") == 3);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x1100, 2);
  node.set_duty(0, 1000);
  CHECK_FALSE(node.drives(0));  // the bite has disarmed it
  node.poll(50'000);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x0C00, 499'999);
  CHECK(node.duty(0) == 1000);
  // Without a latch the status may be written at any value.
  node.write(0x0D00, 0);
  CHECK(node.duty(0) == 1000);
  CHECK(node.read16("01590600") == 3);
}

TEST_CASE("A host that feeds after a bite has not noticed it: its status does not open the latch until it disarms") {
  for (const std::uint32_t disarms : {0x80000000U, 0xFFFFFFFFU, 0U, 1U, 98U}) {
    Node node;
    node.activate();
    node.poll(6'000);
    node.feed();  // goes on, with the duty 0 that it commands just now
    node.set_duty(0, 0);
    node.set_duty(1, 0);
    for (const std::uint32_t clocks : {499'999U, 99U, 0x7FFFFFFFU}) {  // LinuxCNC's soft reset: time, status, DDR
      node.write(0x0C00, clocks);
      node.write(0x0D00, 0);
      node.write(0x1100, 2);
      CHECK(node.read(0x0D00) == 1);
      CHECK(node.read(0x1100) == 0);
    }
    node.write(0x0C00, 0x80000000);  // armed: a bite
    node.feed();
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 1);
    node.write(0x0C00, 1);
    node.feed();  // of a time that bites at once
    node.write(0x0C00, 499'999);
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 1);
    node.write(0x0C00, disarms);
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 0);
    CHECK_FALSE(node.drives(0));
    node.write(0x0C00, 499'999);
    node.write(0x1100, 2);
    node.set_duty(0, 1000);
    CHECK(node.duty(0) == 1000);
    node.feed();  // in time: no sign of anything
    node.set_duty(0, 0);
    node.poll(20'000);
    node.write(0x0D00, 0);
    CHECK(node.read(0x0D00) == 0);
  }
}

TEST_CASE("After power-on too a feed keeps the latch shut, and a bite forgets it") {
  Node node;
  node.feed();
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 1);
  node.write(0x0C00, 0x80000000);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 0);
  CHECK_FALSE(node.core.armed);
  node.feed();  // off stays off
  CHECK_FALSE(node.core.armed);
}

TEST_CASE("Switching the armed watchdog off bites, a time below a us too; unarmed nothing is driven; only 5A feeds") {
  Node node;
  node.activate();
  node.set_duty(0, 1000);
  node.write(0x0C00, 0x80000000);
  CHECK(node.read(0x0D00) == 1);
  node.activate();
  node.set_duty(0, 1000);
  CHECK(node.ask("81C2000C01000000 8142000D") == hex("01000000"));
  CHECK(node.duty(0) == 0);
  for (const std::uint32_t clocks : {0U, 98U}) {
    node.activate();
    node.write(0x0C00, clocks);
    CHECK(node.read(0x0D00) == 1);
  }
  node.activate(99);  // 1 us
  CHECK(node.read(0x0D00) == 0);
  node.poll(1);
  CHECK(node.read(0x0D00) == 1);
  node.write(0x0C00, 0x80000000);  // not armed: no effect on the latch
  node.set_duty(0, 0);
  node.write(0x0D00, 0);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x0C00, 0x80000000);
  CHECK(node.read(0x0D00) == 0);
  node.write(0x1100, 2);
  node.set_duty(0, 1000);
  CHECK(node.duty(0) == 0);  // not armed
  node.activate();
  node.poll(4'000);
  node.write(0x0E00, 0x5B000000);
  node.write(0x0E00, 0x005A0000);
  node.poll(5'001);
  CHECK(node.read(0x0D00) == 1);
}

TEST_CASE("Counts of 16 bits are extended in both directions; a clear, stamps, control, registers that do not exist") {
  Node node;
  std::uint16_t hardware = 0;
  for (int n = 0; n < 1000; ++n) {
    hardware = static_cast<std::uint16_t>(hardware + 32'767U);
    node_count(&node.core, 0, hardware, static_cast<std::uint32_t>(n));
  }
  CHECK(node.read(0x3800) == 32'767'000U);
  CHECK((node.read(0x3000) & 0xFFFFU) == (32'767'000U & 0xFFFFU));
  for (int n = 0; n < 2000; ++n) {
    hardware = static_cast<std::uint16_t>(hardware - 32'768U);
    node_count(&node.core, 0, hardware, 5'000);
  }
  CHECK(static_cast<std::int32_t>(node.read(0x3800)) == 32'767'000 - 65'536'000);
  node.write(0x3200, 48);
  CHECK(node.read(0x3000) >> 16U == 10'000);   // 5,000 us at 2 MHz
  node_count(&node.core, 0, hardware, 7'000);  // no count: the stamp stays
  CHECK(node.read(0x3000) >> 16U == 10'000);
  node.poll(100'000);
  CHECK(node.read(0x3300) == (200'000 & 0xFFFF));
  CHECK(node.read(0x3304) == 0);
  node.write(0x3000, 77);
  CHECK((node.read(0x3000) & 0xFFFFU) == 0);
  node_count(&node.core, 1, 3, 0);
  CHECK((node.read(0x3004) & 0xFFFFU) == 3);
  CHECK(node.read(0x3008) == 0);
  node.write(0x3104, 0xFFFF);
  CHECK(node.read(0x3104) == 0x0FF8);
  CHECK(node.read(0x3400) == 0);
  CHECK(node.read(0x3900) == 0);
  CHECK(node.read(0x0E00) == 0);
  CHECK(node.read(0x1008) == 0);
  node.write(0x3108, 0xFFFF);
  CHECK(node.errors() == 0);
}

TEST_CASE("A write changes the register of its address, and no other") {
  Node node;
  node.activate();
  node_count(&node.core, 0, 100, 0);
  node_count(&node.core, 1, 200, 0);
  for (std::uint32_t group = 0; group < 0x100; ++group) {
    for (const std::uint32_t i : {0U, 1U, 2U, 3U, 63U}) {
      if (group == 0x0C || group == 0x0D || group == 0x0E) continue;
      node_core before = node.core;
      node.write(group << 8U | 4 * i, 0x0FFF0FF8);
      ++before.control[4];
      ++before.control[5];
      before.pointer[0] = static_cast<std::uint16_t>((group << 8U | 4 * i) + 4);
      constexpr std::uint32_t pins = 0x0FFF0FF8U & 0x1FFFFU;
      if (i < 2 && group >= 0x10 && group <= 0x14) before.port[group - 0x10][i] = pins;
      if (i < 2 && group == 0x30) before.count[i] = 0;
      if (i < 2 && group == 0x31) before.counter_control[i] = 0x0FF8;
      if (i < 2 && group == 0x40) before.pwm_value[i] = 0x0FFF0FF8;
      if (i < 2 && group == 0x41) before.pwm_mode[i] = 0x0FFF0FF8;
      if (i == 0 && group == 0x32) before.stamp_divisor = 0x0FF8;
      if (i == 0 && group == 0x34) before.filter = 0x0FFF0FF8;
      if (i == 0 && group == 0x42) before.pwm_rate = 0x0FF8;
      if (i == 0 && group == 0x43) before.pdm_rate = 0x0FFF0FF8;
      if (i == 0 && group == 0x44) before.pwm_enable = 0x0FFF0FF8;
      CAPTURE(group, i);
      CHECK(std::memcmp(&before, &node.core, sizeof before) == 0);
      node_count(&node.core, 0, static_cast<std::uint16_t>(node.core.hardware[0] + 1), 0);
    }
  }
}

TEST_CASE("PWM frequency: the divider of 125 MHz for 200 MHz rate / 2^28, within the chip's range") {
  Node node;
  CHECK(node_pwm_divider(&node.core) == 4095);
  node.write(0x4200, 0xD6);
  const double frequency = 125e6 / (node_pwm_divider(&node.core) / 16.0) / 4096.0;
  CHECK(frequency == Approx(200e6 * 214 / 268435456.0).epsilon(1e-3));
  for (const auto& [rate, divider] :
       {std::pair{1U, 4095U}, {160U, 4095U}, {161U, 4070U}, {320U, 2048U}, {30'000U, 21U}}) {
    node.write(0x4200, rate);
    CHECK(node_pwm_divider(&node.core) == divider);
  }
  node.write(0x4200, 0xFFFF);
  CHECK(node_pwm_divider(&node.core) == 16);
  node.write(0x4300, 6);
  node.write(0x4400, 3);
  node.write(0x3400, 2);
  CHECK(node.core.pdm_rate == 6);
  CHECK(node.core.pwm_enable == 3);
  CHECK(node.core.filter == 2);
}

TEST_CASE("Identity: name, versions, MAC, address, cookie, IDROM, modules and pins") {
  Node node;
  CHECK(node.ask("885D0000") == hex("6162732d6e6f6465 0000000000000000"));
  CHECK(node.ask("835D1000") == hex("03000f000000"));
  CHECK(node.ask("83490200") == hex("03020150ab02"));
  CHECK(node.ask("83491000") == hex("6162732d6e6f"));
  CHECK(node.ask("82492000") == hex("7901a8c0"));
  CHECK(node.ask("81490000 81490800 81492400") == hex("0000 0000 0000"));
  node.activate();
  CHECK(node.ask("88490000") == hex("0000 03020150ab02 0000000000000000"));
  CHECK(node.ask("84420001") == hex("fecaaa55 484f5354 4d4f5432 00040000"));
  CHECK(node.read(0x110) == 0);
  CHECK(node.ask("90420004") ==
        hex("03000000 40000000 00020000 4142532d 4e4f4445 00000000 00000000 02000000 22000000 11000000 00e1f505 "
            "00c2eb0b 04000000 40000000 00010000 04000000"));
  CHECK(node.ask("8F424004") == hex("02000101 000c0300 00000000 03000102 00100500 1f000000 04020102 00300500 03000000 "
                                    "06000202 00400500 03000000 00000000 00000000 00000000"));
  for (std::uint32_t at = 0x470; at < 0x600; at += 4) CHECK(node.read(at) == 0);
  for (const std::uint32_t at : {0x000U, 0x0FCU, 0x200U, 0x204U, 0x300U, 0x700U, 0x704U, 0xC04U, 0xD04U, 0x1304U}) {
    CHECK(node.read(at) == 0);
  }
  for (std::uint32_t pin = 0; pin < 35; ++pin) {
    const std::uint32_t port = pin / 17;
    const std::uint32_t place = pin % 17;
    std::uint32_t expected = pin < 34 ? 0x03000000 : 0;
    if (place == 1) expected = 0x03000681 + 0x10000 * port;
    if (place >= 13 && place <= 15) expected = 0x03000400 + 0x10000 * port + place - 12;
    CHECK(node.read(0x600 + 4 * pin) == (pin < 34 ? expected : 0));
  }
}

TEST_CASE("Clock, scratch, packet counts, errors, pointers, info areas") {
  Node node;
  node.now_us = 0x12345;
  CHECK(node.ask("01510000") == hex("4523"));
  CHECK(node.ask("82D10200 11223344").empty());
  CHECK(node.ask("82510200") == hex("11223344"));
  CHECK(node.ask("84D11000 0102030405060708").empty());
  CHECK(node.ask("84511000") == hex("0102030405060708"));
  CHECK(node.ask("81511800") == hex("0000"));
  CHECK(node.read16("01590800") == 7);
  CHECK(node.read16("01590A00") == 8);
  CHECK(node.read16("01590E00") == 6);
  CHECK(node.read16("01591000") == 7);
  CHECK(node.ask("82D11100 AABBCCDD").empty());  // an odd address is followed by odd ones
  CHECK(node.ask("84511000") == hex("01AABBCCDD060708"));
  CHECK(node.read16("01592000") == 0);
  CHECK(node.ask("81D11800 0000 81D10000 0000").empty());
  CHECK(node.ask("82510000").size() == 4);
  CHECK(node.errors() == 4);
  CHECK(node.ask("81D90000 0000").empty());
  CHECK(node.errors() == 0);
  node.ask("81D11800 0000");
  CHECK(node.ask("81511800 01590000") == hex("0000 0400"));  // beyond: nothing; the errors are another space's
  node.ask("81D90000 0000");
  CHECK(node.ask("81D90200 0000").empty());
  CHECK(node.errors() == 4);
  node.ask("81D90000 0000");
  CHECK(node.errors() == 0);
  CHECK(node.ask("81D90400 0000 81C92000 0000").empty());
  CHECK(node.read16("01590600") == 2 + 2 + 2 + 2 + 2 + 2);  // two bytes each
  CHECK(node.ask("01610000 01690000 01710000 01790000 017D0000") == hex("005a 025a 045a 065a 075a"));
  CHECK(node.ask("01650000 016D0000 01750000") == hex("0000 0000 0000"));  // no such spaces; 5 is the emulator's
  CHECK(node.ask("84610800") == Bytes({'H', 'o', 's', 't', 'M', 'o', 't', '2'}));
  CHECK(node.ask("01610200 01710200 01611000") == hex("0400 0200 0000"));
  // A pointer moves with an increment only; the info area shows it and moves nothing.
  CHECK(node.ask("81420001 0102 0102 0161 0600") == hex("fecaaa55 484f5354 484f5354 0401"));
  CHECK(node.ask("0102") == hex("484f5354"));
  CHECK(node.ask("01592000") == hex("0000"));  // beyond the last word, whatever the pointers are
  for (int n = 0; n < 300; ++n) node.ask("0102");
  const std::uint32_t received = node.read16("01590800");
  CHECK(received > 300);
  CHECK(node.read16("01591000") > 256);
  CHECK(node.ask("01590900") ==
        Bytes{static_cast<std::uint8_t>(received >> 8U), static_cast<std::uint8_t>(received + 2)});
  const std::uint32_t sent = node.read16("01590E00");
  CHECK(node.ask("01400000") == hex("00"));  // an answer of one byte is one too
  CHECK(node.ask("00420000").empty());       // and none is none
  CHECK(node.read16("01590E00") == sent + 2);
}

TEST_CASE("A command that its space does not take reads zeros and is counted, a write to one does nothing") {
  Node node;
  CHECK(node.ask("81410001") == hex("0000"));
  CHECK(node.ask("81430001") == Bytes(8, 0));
  CHECK(node.ask("01460000 014E0000 01550000") == hex("00000000 00000000 0000"));
  CHECK(node.ask("01620000") == hex("00000000"));
  CHECK(node.ask("01E10000 0000").empty());
  CHECK(node.ask("81C1000C FFFF").empty());
  CHECK(node.read(0x0C00) == 0x80000000);
  CHECK(node.errors() == 2);
  CHECK(node.read16("01590400") == 8);
}

TEST_CASE("A datagram that breaks off, or asks for more than a packet, does nothing at all") {
  Node node;
  for (const char* text : {"81C2000C 1FA1070081", "81C2000C 1FA1070081C2", "81C2000C 1FA1070081C2000C 000000",
                           "81C2000C 1FA107008142000D81", "81C2000C 1FA107008142000D 8142 00"}) {
    CHECK(node.ask(text).empty());
  }
  CHECK(node.ask("81C2000C 1FA10700 FF420001 FF420001 FF420001").empty());
  // What there is of the data of a write would be two whole commands.
  CHECK(node.ask("81C2000C 1FA10700 82C20040 00000000").empty());
  CHECK(node.read(0x0C00) == 0x80000000);
  CHECK(node.errors() == 1);
  CHECK(node.read16("01590200") == 7);
  // Data that are written are no answer.
  Bytes both = hex("FFC20050");
  both.resize(both.size() + std::size_t{127} * 4);
  for (const std::uint8_t byte : hex("FF420001 FF420001 F2420001")) both.push_back(byte);
  CHECK(node.ask(both).size() == NODE_MOST_BYTES);
  CHECK(node.ask("FF420001 FF420001 F0420001").size() == 127 * 8 + 112 * 4);
  CHECK(node.ask("FF420001 FF420001 F1420001").size() == 127 * 8 + 113 * 4);
  CHECK(node.ask("FF420001 FF420001 F2420001").size() == NODE_MOST_BYTES - 4 + 4);
  CHECK(node.ask("FF420001 FF420001 F3420001").empty());
}

TEST_CASE(
    "While outputs are permitted a repeated or older write number does not act; latched or activated anew it may") {
  Node node;
  const auto numbered = [&node](std::uint32_t steps, std::uint32_t number) {
    Bytes d = hex("81C20040 00000000 81C2000E 0000005A 82D11400 00000000");
    d[6] = static_cast<std::uint8_t>(steps);
    d[7] = static_cast<std::uint8_t>(steps >> 8U);
    for (int i = 0; i < 4; ++i) d[20U + static_cast<unsigned>(i)] = static_cast<std::uint8_t>(number >> 8 * i);
    CHECK(node.ask(d).empty());
    return node.duty(0);
  };
  numbered(0, 900);
  node.activate();
  CHECK(numbered(100, 7) == 100);  // the first one after an activation
  CHECK(numbered(200, 8) == 200);
  CHECK(numbered(300, 8) == 200);
  CHECK(numbered(300, 7) == 200);
  CHECK(numbered(300, 8 + 0x80000000U) == 200);
  CHECK(numbered(300, 8 + 0x7FFFFFFFU) == 300);
  CHECK(numbered(400, 8 + 0x80000000U) == 400);  // across the sign
  CHECK(node.errors() == 4);
  CHECK(node.read16("01590600") == 3);
  // A refused one does not feed.
  node.poll(4'000);
  numbered(500, 8 + 0x7FFFFFFFU);
  node.poll(5'000);
  CHECK(node.read(0x0D00) == 1);
  numbered(0, 3);  // latched: the numbers may begin anew
  node.activate();
  CHECK(numbered(600, 4) == 600);
  // Other commands of that space, or of another size, are no numbers.
  CHECK(node.ask("81D11400 0100 82D11600 00000000 81D21400 01000000 02 51 1400").size() == 4);
  CHECK(numbered(700, 5) == 700);
  // Numbers of a broken datagram do not count.
  CHECK(node.ask("82D11400 09000000 81").empty());
  CHECK(numbered(800, 6) == 800);
}

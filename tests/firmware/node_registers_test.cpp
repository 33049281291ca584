// The node's registers and counters without its chip: counts, stamps, identity, memory spaces.

#include <cstring>

#include "node_by_hand.hpp"

using namespace node_test;

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
  CHECK(node.read16("01590600") == 4);  // one for each refused datagram
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

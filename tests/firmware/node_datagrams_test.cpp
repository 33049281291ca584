// What the node makes of datagrams that it does not take, and of repeated ones.

#include "node_by_hand.hpp"

using namespace node_test;

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

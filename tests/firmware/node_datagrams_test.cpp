// What the node makes of datagrams that it does not take, and of repeated ones.

#include <cstring>

#include "node_by_hand.hpp"

using namespace node_test;

TEST_CASE("A command that its space does not take reads zeros and is counted; a write to one is refused") {
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
    "While outputs are permitted a write number that is not one of the next does not act; latched or activated anew it "
    "may") {
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
  constexpr std::uint32_t last = 0xFFFFFFFF;
  CHECK(numbered(100, last - 1) == 100);  // the first one after an activation
  CHECK(numbered(200, last) == 200);
  CHECK(numbered(300, last) == 200);
  CHECK(numbered(300, last - 1) == 200);
  CHECK(numbered(300, last + 1025) == 200);  // of another session
  CHECK(numbered(300, last + 1024) == 300);
  CHECK(numbered(400, last + 1025) == 400);
  CHECK(node.errors() == 4);
  CHECK(node.read16("01590600") == 3);
  // A refused one does not feed.
  node.poll(4'000);
  numbered(500, last);
  node.poll(5'000);
  CHECK(node.read(0x0D00) == 1);
  numbered(0, 3);  // latched: the numbers may begin anew
  node.activate();
  CHECK(numbered(600, 4) == 600);
  CHECK(node.ask("82D11000 01000000 82511400").size() == 4);  // the read number beside it is none
  CHECK(numbered(700, 5) == 700);
  // Numbers of a broken datagram do not count.
  CHECK(node.ask("82D11400 09000000 81").empty());
  CHECK(numbered(800, 6) == 800);
}

TEST_CASE("A number counts however it is written, and the one of the activation too") {
  const std::string duty_200 = "81C20040 0000C800 81C2000E 0000005A ";
  for (const std::string activation_has : {"", "82D11400 64000000"}) {
    for (const char* stale : {"82D11400 63000000",            // 99
                              "82D11400 64000000",            // 100 again
                              "82D11400 65040000",            // too far ahead
                              "81D11200 0000 8291 63000000",  // through the pointer that the first command leaves
                              "84D11000 0900000063000000",    // with the read number
                              "81D11400 6300 81D11600 0000",  // by halves
                              "81D11400 6300",                // one half
                              "81D11600 0000",                // the other
                              "81D11300 0064",                // one byte
                              "82511000 8291 63000000",       // a read moves the pointer
                              "82D11400 65000000 82D11400 63000000"})  // the last one is the datagram's
    {
      Node node;
      CHECK(node.ask("82D11400 00010000").empty());  // of an earlier session
      // As one datagram: values 0, alternate source, watchdog, status, DDR.
      CHECK(node.ask("82C20040 0000000000000000 82C20041 0300000003000000 82C20012 0200000002000000 81C2000C 1FA10700 "
                     "81C2000D 00000000 "
                     "82C20011 0200000002000000" +
                     activation_has)
                .empty());
      REQUIRE(node.drives(0));
      if (activation_has.empty()) CHECK(node.ask("82D11400 64000000").empty());
      CAPTURE(activation_has, stale);
      CHECK(node.ask(duty_200 + stale).empty());
      CHECK(node.duty(0) == 0);
      CHECK(node.read16("01590600") == 1);
      CHECK(node.ask("81511400") == hex("6400"));
      CHECK(node.ask(duty_200 + "82D11400 65000000").empty());
      CHECK(node.duty(0) == 200);
    }
  }
}

TEST_CASE("A datagram with a refused write changes nothing, wherever in it that write stands") {
  Node node;
  node.activate();
  const std::string good = "81C20040 00000004 81C2000E 0000005A 82D11400 09000000 81420001 ";
  const auto changes_nothing = [&](const std::string& datagram) {
    node_core before = node.core;
    CAPTURE(datagram);
    CHECK(node.ask(datagram).empty());
    for (const int packets : {4, 5}) ++before.control[packets];
    CHECK(node.core.control[1] + node.core.control[2] + node.core.control[3] ==
          before.control[1] + before.control[2] + before.control[3] + 1);
    CHECK(node.core.control[0] != 0);
    for (const int errors : {0, 1, 2, 3}) before.control[errors] = node.core.control[errors];
    CHECK(std::memcmp(&before, &node.core, sizeof before) == 0);
  };
  const auto in_any_place = [&](const std::string& refused) {
    changes_nothing(refused + good);
    changes_nothing(good + refused);
  };
  node.poll(1'000);
  in_any_place("81C50000 0000");      // space 1
  in_any_place("81C10040 0000");      // units of another size
  in_any_place("81C20240 00000004");  // not a register's address
  in_any_place("81D10000 0000");      // the clock
  in_any_place("82D11600 00000000");  // beyond the number
  in_any_place("81DD0000 0000");      // the board's name
  changes_nothing(good + "81C2");
  changes_nothing(good + "FF420001 FF420001 FF420001");
  node.poll(6'000);
  in_any_place("82C20011 0200000002000000");  // DDR while latched
  node.feed();
  in_any_place("81C2000C 1F4E0000 81C2000D 00000000");  // the status of a host that has fed
  CHECK(node.core.number_known == false);
}

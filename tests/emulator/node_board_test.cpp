// The emulated node beside the emulated 7I92T: two parties that share no line, given the same datagrams.

#include <cmath>

#include "catch.hpp"
#include "emulator/udp_board.hpp"

using namespace abs_hil;
using namespace abs_hil::emulator;
using Catch::Matchers::Contains;
using Bytes = std::vector<std::uint8_t>;

namespace {

constexpr std::int64_t ms = 1'000'000;

Bytes hex(const std::string& text) {
  Bytes bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += text[i] == ' ' ? 1 : 2) {
    if (text[i] != ' ') bytes.push_back(static_cast<std::uint8_t>(std::stoul(text.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

/// Values 0, 12 bits, 160 Hz, inversion, PWM pins, watchdog of 5 ms, status, DDR.
const Bytes activation =
    hex("82C20040 0000000000000000 82C20041 0300000003000000 81C20042 D6000000 82C20014 0200000002000000 "
        "82C20012 0200000002000000 81C2000C 1FA10700 81C2000D 00000000 82C20011 0200000002000000");
/// Drive 0.25, brake 0.7, reload.
const Bytes command = hex("82C20040 00000004 0000320B 81C2000E 0000005A");

}  // namespace

TEST_CASE("Node and 7I92T: the same activation and command, the same duties, zero after the same time") {
  const auto made_hm2 = hm2_board({});
  UdpBoard& hm2 = *made_hm2;
  const auto made_node = node_board({.name = "abs-node"});
  UdpBoard& node = *made_node;
  for (UdpBoard* const board : std::initializer_list<UdpBoard*>{&hm2, &node}) {
    CHECK(board->bitten());
    CHECK(board->answer(activation).empty());
    CHECK_FALSE(board->bitten());
    board->advance_to(2 * ms);
    CHECK(board->answer(command).empty());
    CHECK(board->outputs().drive_duty == 0.25);
    CHECK(board->outputs().brake_duty == 2866.0 / 4096.0);
    CHECK(board->drives_pins());
    board->advance_to(7 * ms - 1000);
    CHECK(board->outputs().brake_duty > 0.5);
    board->advance_to(7 * ms + 1000);
    CHECK(board->outputs().brake_duty == 0.0);
    CHECK(board->outputs().drive_duty == 0.0);
    CHECK(board->bitten());
    CHECK_FALSE(board->drives_pins());
    const auto events = board->log().take_events();
    REQUIRE_FALSE(events.empty());
    CHECK_THAT(events.back().text, Contains("outputs zero: watchdog; watchdog last reloaded 5.000 ms ago"));
    // What LinuxCNC's soft reset does brings a HostMot2 back, and not the node.
    Bytes soft_reset = command;
    for (const std::uint8_t byte : hex("81C2000D 00000000 82C20011 0200000002000000")) soft_reset.push_back(byte);
    CHECK(board->answer(soft_reset).empty());
    CHECK((board->outputs().brake_duty > 0.5) == (board == &hm2));
    board->power_cycle();
    CHECK(board->bitten());
    CHECK(board->outputs().brake_duty == 0.0);
  }
}

TEST_CASE("The node counts as the 7I92T does, forwards and backwards, from power-on") {
  const auto made_hm2 = hm2_board({.start_speed_rad_s = 120.0});
  UdpBoard& hm2 = *made_hm2;
  const auto made_node = node_board({.start_speed_rad_s = 120.0, .name = "abs-node"});
  UdpBoard& node = *made_node;
  for (int n = 1; n <= 50; ++n) {
    hm2.advance_to(n * ms);
    node.advance_to(n * ms);
    const Bytes a = hm2.answer(hex("82420030"));
    const Bytes b = node.answer(hex("82420030"));
    for (const std::size_t i : {0U, 1U, 4U, 5U}) CHECK(a.at(i) == b.at(i));
  }
  node.turn_by_hand(true, -40.0);
  hm2.turn_by_hand(true, -40.0);
  CHECK(hm2.answer(hex("01420430")).at(0) == node.answer(hex("01420430")).at(0));
}

TEST_CASE("In lock-step the host advances the node's time, alone or before other commands; hardware has no space 5") {
  const auto made_node = node_board({.lock_step = true});
  UdpBoard& node = *made_node;
  CHECK(node.answer(hex("82D60000 40420F0000000000")).empty());
  CHECK(node.time_ns() == 1 * ms);
  CHECK(node.answer(hex("82560000")) == hex("40420F0000000000"));
  CHECK(node.answer(hex("82750000")) == hex("055A 0F00"));
  CHECK(node.answer(hex("82D60000 80841E0000000000 01510000")) == hex("D007"));
  CHECK(node.answer(hex("01510000 82560000 82750000 01510000")) == hex("D007 80841E0000000000 055A0F00 D007"));
  const auto made_real = node_board({});
  UdpBoard& real = *made_real;
  CHECK(real.answer(hex("82560000")) == Bytes(8, 0));
  CHECK(real.answer(hex("82750000")) == hex("055A 0000"));  // the mark of an emulator, which keeps its own time
  CHECK(real.time_ns() == 0);
  CHECK_THROWS_WITH(node_board({.name = ""}), Contains("1 to 16"));
}

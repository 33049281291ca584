// LCM's packets over UDP: whole, in fragments, and broken.
#include <string>
#include <vector>

#include "catch.hpp"
#include "commands/receiver.hpp"

namespace abs_hil::commands {
namespace {

using Kind = LcmPacket::Kind;
using Datagram = std::vector<std::uint8_t>;

// Headers by LCM's "UDP multicast protocol description", written out by hand.
Datagram operator+(Datagram bytes, const std::string& text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
  return bytes;
}
const Datagram whole{'L', 'C', '0', '2', 0, 0, 0, 7};
/// Message 7 of 1000 bytes in 3 fragments; `number` of the fragment, at `offset`.
Datagram fragment(std::uint8_t number, std::uint32_t offset = 0) {
  Datagram bytes{'L', 'C', '0', '3', 0, 0, 0, 7, 0, 0, 0x03, 0xE8};
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::uint8_t>(offset >> shift));
  for (const std::uint8_t byte : {std::uint8_t{0}, number, std::uint8_t{0}, std::uint8_t{3}}) bytes.push_back(byte);
  return bytes;
}
const std::string command{"ABS_COMMAND\0", 12};

TEST_CASE("a whole message of the channel is its payload") {
  const Datagram datagram = whole + command + "payload";
  const LcmPacket packet = look_at(datagram, "ABS_COMMAND");
  REQUIRE(packet.kind == Kind::message);
  CHECK(std::string(packet.payload.begin(), packet.payload.end()) == "payload");
  CHECK(packet.payload.data() == datagram.data() + 20);
  const Datagram empty = whole + command;
  CHECK(look_at(empty, "ABS_COMMAND").kind == Kind::message);
  CHECK(look_at(empty, "ABS_COMMAND").payload.empty());
}

TEST_CASE("longer, shorter and cut names are other channels") {
  for (const char* other : {"ABS_COMMAND_STATE", "ABS_COMMAN", "BS_COMMAND", "abs_command", "X"}) {
    CHECK(look_at(whole + std::string(other) + std::string("\0payload", 8), "ABS_COMMAND").kind == Kind::other);
  }
  CHECK(look_at(whole + "ABS_COMMAND", "ABS_COMMAND").kind == Kind::other);  // no NUL
  CHECK(look_at(whole + "ABS_COM", "ABS_COMMAND").kind == Kind::other);
}

TEST_CASE("the first fragment of the channel is known, whatever it says about the rest") {
  CHECK(look_at(fragment(0) + command + "xx", "ABS_COMMAND").kind == Kind::fragmented);
  CHECK(look_at(fragment(0, 0xFFFFFFF0) + command, "ABS_COMMAND").kind == Kind::fragmented);
  CHECK(look_at(fragment(0) + std::string("OTHER\0", 6), "ABS_COMMAND").kind == Kind::other);
  CHECK(look_at(fragment(1) + command, "ABS_COMMAND").kind == Kind::other);
  CHECK(look_at(fragment(0), "ABS_COMMAND").kind == Kind::other);
}

TEST_CASE("packets that are cut anywhere or are not LCM have no channel") {
  for (const Datagram& datagram : {whole + command, fragment(0) + command}) {
    for (std::size_t size = 0; size < datagram.size(); ++size) {
      CAPTURE(size);
      CHECK(look_at(std::span(datagram).first(size), "ABS_COMMAND").kind == Kind::other);
    }
  }
  Datagram wrong = whole + command;
  wrong[3] = '1';
  CHECK(look_at(wrong, "ABS_COMMAND").kind == Kind::other);
}

}  // namespace
}  // namespace abs_hil::commands

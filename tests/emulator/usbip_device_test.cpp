// Requests of the kernel's virtual host controller and the expected replies, byte by byte (USB/IP protocol).

#include "emulator/usbip_device.hpp"

#include <cstring>

#include "catch.hpp"

using namespace abs_hil::emulator;

namespace {

using Bytes = std::vector<std::uint8_t>;

void put(Bytes& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(value >> shift));
}

std::uint32_t number(const Bytes& bytes, std::size_t at) {
  return static_cast<std::uint32_t>(bytes[at]) << 24U | static_cast<std::uint32_t>(bytes[at + 1]) << 16U |
         static_cast<std::uint32_t>(bytes[at + 2]) << 8U | bytes[at + 3];
}

Bytes submit(std::uint32_t sequence, bool in, std::uint32_t endpoint, std::uint32_t length, const Bytes& setup = {},
             const Bytes& data = {}) {
  Bytes bytes;
  for (const std::uint32_t value : {1U, sequence, 0x10002U, in ? 1U : 0U, endpoint, 0U, length, 0U, 0U, 0U}) {
    put(bytes, value);
  }
  bytes.insert(bytes.end(), setup.begin(), setup.end());
  bytes.resize(48);
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

Bytes unlink(std::uint32_t sequence, std::uint32_t unlinked) {
  Bytes bytes;
  for (const std::uint32_t value : {2U, sequence, 0x10002U, 0U, 0U, unlinked}) put(bytes, value);
  bytes.resize(48);
  return bytes;
}

const Bytes request{0xFF, 0x8F, 0, 0};

struct Host {
  UsbBoardModel board{{}};
  UsbipDevice device{board, {}, 1};
  std::int64_t now_ns{0};

  Bytes send(const Bytes& bytes) {
    Bytes replies;
    device.receive(bytes, now_ns, replies);
    return replies;
  }
  Bytes late() {
    Bytes replies;
    device.give_answers(now_ns, replies);
    return replies;
  }
  Bytes ask(std::uint32_t sequence) { return send(submit(sequence, false, 2, 4, {}, request)); }
};

constexpr std::uint32_t stall = static_cast<std::uint32_t>(-32);

}  // namespace

TEST_CASE("Descriptors: a high-speed device of the maker's name, with the endpoints of frames and of JTAG") {
  Host host;
  const Bytes device = host.send(submit(7, true, 0, 18, {0x80, 6, 0, 1, 0, 0, 18, 0}));
  REQUIRE(device.size() == 48 + 18);
  CHECK(number(device, 0) == 3);
  CHECK(number(device, 4) == 7);
  CHECK(number(device, 20) == 0);
  CHECK(number(device, 24) == 18);
  CHECK(device[48 + 8] == 0x09);  // 1209
  CHECK(device[48 + 9] == 0x12);
  const Bytes configuration = host.send(submit(8, true, 0, 255, {0x80, 6, 0, 2, 0, 0, 255, 0}));
  REQUIRE(configuration.size() == 48 + 9 + 9 + 4 * 7);
  CHECK(configuration[48 + 2] == 46);
  CHECK(configuration[48 + 18 + 2] == 0x02);
  CHECK(configuration[48 + 25 + 2] == 0x84);
  const Bytes maker = host.send(submit(9, true, 0, 255, {0x80, 6, 1, 3, 9, 4, 255, 0}));
  CHECK(maker[48 + 2] == 'I');
  CHECK(maker[48 + 12] == 'o');
  const Bytes short_one = host.send(submit(10, true, 0, 8, {0x80, 6, 0, 1, 0, 0, 8, 0}));
  CHECK(short_one.size() == 48 + 8);
  CHECK(number(host.send(submit(11, true, 0, 10, {0x80, 6, 0, 6, 0, 0, 10, 0})), 20) == stall);  // no other speed
  CHECK(number(host.send(submit(12, false, 0, 0, {0x00, 9, 1, 0, 0, 0, 0, 0})), 20) == 0);       // configuration 1
}

TEST_CASE("A request is answered with a frame, whether the read comes before or after it") {
  Host host;
  CHECK(host.send(submit(1, true, 4, 512)).empty());  // waits
  Bytes replies = host.ask(2);
  REQUIRE(replies.size() == 48 + 48 + 504);
  CHECK(number(replies, 4) == 2);  // the request is taken
  CHECK(number(replies, 24) == 4);
  CHECK(number(replies, 48 + 4) == 1);
  CHECK(number(replies, 48 + 24) == 504);
  CHECK(replies[96] == 103);
  CHECK(host.ask(3).size() == 48);
  CHECK(host.send(submit(4, true, 4, 512)).size() == 48 + 504);
  CHECK(host.send(submit(5, true, 4, 512)).empty());  // one answer a request
}

TEST_CASE("Commands may come in any pieces") {
  Host host;
  Bytes all = submit(1, true, 4, 512);
  const Bytes asking = submit(2, false, 2, 4, {}, request);
  all.insert(all.end(), asking.begin(), asking.end());
  Bytes replies;
  for (const std::uint8_t byte : all) host.device.receive(std::span(&byte, 1), 0, replies);
  CHECK(replies.size() == 48 + 48 + 504);
}

TEST_CASE("A cancelled read is never answered") {
  Host host;
  CHECK(host.send(submit(1, true, 4, 512)).empty());
  const Bytes gone = host.send(unlink(2, 1));
  REQUIRE(gone.size() == 48);
  CHECK(number(gone, 0) == 4);
  CHECK(number(gone, 4) == 2);
  CHECK(number(gone, 20) == static_cast<std::uint32_t>(-104));
  CHECK(number(host.send(unlink(3, 1)), 20) == 0);  // not there any more
  CHECK(host.ask(4).size() == 48);
}

TEST_CASE("Faults: STALL until cleared, silence, lateness, length") {
  Host host;
  SECTION("STALL of IN, which the host clears") {
    host.device.faults.set("stall in once");
    CHECK(number(host.send(submit(1, true, 4, 512)), 20) == stall);
    CHECK(number(host.send(submit(2, false, 0, 0, {2, 1, 0, 0, 0x84, 0, 0, 0})), 20) == 0);
    CHECK(host.send(submit(3, true, 4, 512)).empty());
  }
  SECTION("STALL of OUT, which stays") {
    host.device.faults.set("stall out");
    CHECK(number(host.ask(1), 20) == stall);
    static_cast<void>(host.send(submit(2, false, 0, 0, {2, 1, 0, 0, 0x02, 0, 0, 0})));
    CHECK(number(host.ask(3), 20) == stall);
  }
  SECTION("silence") {
    host.device.faults.set("silent");
    CHECK(host.send(submit(1, true, 4, 512)).empty());
    CHECK(host.ask(2).size() == 48);
  }
  SECTION("late, twice") {
    host.device.faults.set("late 1000 2");
    CHECK(host.send(submit(1, true, 4, 512)).empty());
    CHECK(host.ask(2).size() == 48);
    host.now_ns = 999'999;
    CHECK(host.late().empty());
    host.now_ns = 1'000'000;
    CHECK(host.late().size() == 48 + 504);
    CHECK(host.send(submit(3, true, 4, 512)).empty());
    CHECK(host.ask(4).size() == 48);
    host.now_ns = 2'000'000;
    CHECK(host.late().size() == 48 + 504);
    CHECK(host.send(submit(5, true, 4, 512)).empty());
    CHECK(host.ask(6).size() == 48 + 48 + 504);
  }
  SECTION("short, and longer than the host takes") {
    host.device.faults.set("length 100");
    CHECK(host.send(submit(1, true, 4, 512)).empty());
    CHECK(host.ask(2).size() == 48 + 48 + 100);
    CHECK(host.ask(3).size() == 48);
    const Bytes babble = host.send(submit(4, true, 4, 64));
    CHECK(number(babble, 20) == static_cast<std::uint32_t>(-75));
    CHECK(babble.size() == 48 + 64);
  }
}

TEST_CASE("The host can advance the rig's time only in lock-step") {
  Host host;
  const Bytes ask_time{0xC0, 0x54, 0, 0, 0, 0, 8, 0};
  CHECK(number(host.send(submit(1, true, 0, 8, ask_time)), 20) == stall);
  UsbipDevice device(host.board, {}, 1, [&host](std::int64_t time_ns) { host.board.advance_to(time_ns); });
  Bytes time(8);
  const std::int64_t wanted_ns = 5'000'000;
  std::memcpy(time.data(), &wanted_ns, sizeof wanted_ns);
  Bytes replies;
  device.receive(submit(2, false, 0, 8, {0x40, 0x54, 0, 0, 0, 0, 8, 0}, time), 0, replies);
  CHECK(host.board.time_ns() == wanted_ns);
  replies.clear();
  device.receive(submit(3, true, 0, 8, ask_time), 0, replies);
  CHECK(Bytes(replies.begin() + 48, replies.end()) == time);
}

TEST_CASE("JTAG endpoints are refused and counted; an invalid command ends the connection") {
  Host host;
  CHECK(number(host.send(submit(1, false, 6, 4, {}, request)), 20) == stall);
  CHECK(number(host.send(submit(2, true, 8, 64)), 20) == stall);
  CHECK(host.device.jtag_transfers() == 2);
  Bytes nonsense(48, 0xEE);
  CHECK_THROWS_AS(host.send(nonsense), std::runtime_error);
}

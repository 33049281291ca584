// Sending and receiving CAN frames through a socket of the kernel.
#include <linux/can.h>
#include <linux/can/error.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <utility>

#include "catch.hpp"
#include "driver/can/bus.hpp"
#include "driver/monotonic_time.hpp"

using namespace abs_hil::driver::can;
using abs_hil::driver::IoError;
using abs_hil::driver::IoResult;
using abs_hil::driver::monotonic_ns;

namespace {

struct Pair {
  Pair() { REQUIRE(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) == 0); }
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;
  ~Pair() { ::close(ends[1]); }
  std::array<int, 2> ends{};
};

}  // namespace

TEST_CASE("Frames go out and come in as the kernel's structures, with a time stamp") {
  Pair pair;
  FrameSocket socket(pair.ends[0]);
  Frame frame{.id = 0x81, .length = 3, .data = {1, 2, 3}};
  CHECK(socket.send(frame).error == IoError::none);
  can_frame raw{};
  REQUIRE(::recv(pair.ends[1], &raw, sizeof raw, 0) == CAN_MTU);
  CHECK(raw.can_id == 0x81);
  CHECK(raw.can_dlc == 3);
  CHECK(raw.data[2] == 3);

  raw.can_id = 0x92;
  const std::int64_t before_ns = monotonic_ns();
  REQUIRE(::send(pair.ends[1], &raw, sizeof raw, 0) == CAN_MTU);
  Frame received;
  CHECK(socket.receive(received, 0).error == IoError::none);
  CHECK(received.id == 0x92);
  CHECK(received.length == 3);
  CHECK_FALSE(received.fd);
  CHECK_FALSE(received.error);
  CHECK(received.received_ns >= before_ns - 1'000'000);
  CHECK(received.received_ns <= monotonic_ns());
  CHECK(socket.receive(received, 0).error == IoError::no_answer);
}

TEST_CASE("FD frames, extended frames and invalid sizes") {
  Pair pair;
  FrameSocket socket(pair.ends[0]);
  Frame frame{.id = 0x94, .length = 24, .fd = true};
  CHECK(socket.send(frame).error == IoError::none);
  canfd_frame raw{};
  REQUIRE(::recv(pair.ends[1], &raw, sizeof raw, 0) == CANFD_MTU);
  CHECK(raw.len == 24);
  raw.len = 255;  // no length that a frame can have
  static_cast<void>(::send(pair.ends[1], &raw, CANFD_MTU, 0));
  Frame received;
  CHECK(socket.receive(received, 0).error == IoError::none);
  CHECK(received.length == CANFD_MAX_DLEN);
  CHECK(received.fd);

  can_frame extended{};
  extended.can_id = 0x92U | CAN_EFF_FLAG;
  static_cast<void>(::send(pair.ends[1], &extended, sizeof extended, 0));
  CHECK(socket.receive(received, 0).error == IoError::none);
  CHECK(received.id != 0x92);

  static_cast<void>(::send(pair.ends[1], &raw, 5, 0));
  CHECK(socket.receive(received, 0).error == IoError::incomplete_answer);
  const std::array<unsigned char, 79> too_long{};  // cut off where an FD frame ends
  static_cast<void>(::send(pair.ends[1], too_long.data(), too_long.size(), 0));
  CHECK(socket.receive(received, 0).error == IoError::incomplete_answer);
}

TEST_CASE("drain() discards everything received, also malformed data") {
  Pair pair;
  FrameSocket socket(pair.ends[0]);
  can_frame raw{};
  raw.can_id = 0x92;
  REQUIRE(::send(pair.ends[1], &raw, sizeof raw, 0) == CAN_MTU);
  REQUIRE(::send(pair.ends[1], &raw, 5, 0) == 5);
  REQUIRE(::send(pair.ends[1], &raw, sizeof raw, 0) == CAN_MTU);
  socket.drain();
  Frame received;
  CHECK(socket.receive(received, 0).error == IoError::no_answer);
}

TEST_CASE("A full queue is reported as full, a closed peer as down") {
  Pair pair;
  FrameSocket socket(pair.ends[0]);
  Frame frame{.id = 0x81, .length = 8};
  int sent = 0;
  IoResult result = socket.send(frame);
  while (result.error == IoError::none && sent < 1'000'000) {
    ++sent;
    result = socket.send(frame);
  }
  CHECK(result.error == IoError::no_answer);
  CHECK(sent > 0);
  ::shutdown(pair.ends[1], SHUT_RDWR);
  CHECK(socket.send(frame).error == IoError::disconnected);
  Frame received;
  CHECK(socket.receive(received, 0).error == IoError::disconnected);
}

TEST_CASE("Error frames give the controller's state") {
  Pair pair;
  FrameSocket socket(pair.ends[0]);
  const auto report_of = [&](std::uint32_t kind, std::uint8_t controller) {
    can_frame raw{};
    raw.can_id = CAN_ERR_FLAG | kind;
    raw.can_dlc = CAN_ERR_DLC;
    raw.data[1] = controller;
    static_cast<void>(::send(pair.ends[1], &raw, sizeof raw, 0));
    Frame received;
    REQUIRE(socket.receive(received, 0).error == IoError::none);
    REQUIRE(received.error);
    return bus_report(received);
  };
  CHECK(report_of(CAN_ERR_BUSOFF, 0).bus_off);
  CHECK(report_of(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE).error_passive);
  CHECK(report_of(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE).error_passive);
  CHECK(report_of(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW).receive_overflow);
  const BusReport warning = report_of(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING);
  CHECK(warning.error_warning);
  CHECK_FALSE(warning.error_passive);
  CHECK_FALSE(warning.bus_off);
  const BusReport other = report_of(CAN_ERR_ACK, CAN_ERR_CRTL_TX_PASSIVE);  // data[1] means nothing without CRTL
  CHECK_FALSE(other.error_passive);
}

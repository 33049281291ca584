// Any bytes as frames and as datagrams at the driver's side of the bus: no value past the decoder is out of its range.
// Input: any number of records "kind, identifier, length, data ...".
#include <linux/can.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>

#include "driver/can/bus.hpp"
#include "driver/can/can_driver.hpp"
#include "driver/can/protocol.hpp"
#include "fuzz_input.hpp"

namespace {

using namespace abs_hil::driver::can;
using namespace abs_hil::fuzz;

/// Identifiers of the protocol come more often than others, right checks more often than by chance.
Frame frame_in(Input& input) {
  Frame frame;
  const unsigned kind = input.byte();
  const auto known = messages();
  frame.id = (kind & 1U) != 0 ? known[input.byte() % known.size()].id : input.byte() * 8U + input.byte() % 8U;
  frame.fd = (kind & 2U) != 0;
  frame.error = (kind & 4U) != 0;
  const Message* message = find_message(frame.id);
  frame.length = (kind & 8U) != 0 && message != nullptr
                     ? message->bytes
                     : static_cast<std::uint8_t>(input.byte() % (Frame::most_bytes + 1));
  if (!frame.fd && frame.length > 8) frame.length = 8;
  for (std::size_t i = 0; i < frame.length; ++i) frame.data[i] = input.byte();
  if ((kind & 16U) != 0 && frame.length > 0) frame.data[frame.length - 1U] = checksum(frame);
  return frame;
}

void expect_in_range(const Decoded& decoded, AnswerTracker& tracker) {
  const Values& v = decoded.values;
  expect((decoded.error == DecodeError::none) == (decoded.id != 0));
  expect(v.trip_flags >= 0 && v.trip_flags <= 7 && v.node_state >= 0 && v.node_state <= 2);
  expect(v.latch_reason >= 0 && v.latch_reason <= 2);
  expect(std::isnan(v.supply_V()) || (v.supply_V() >= 0.0 && v.supply_V() < 65.535));
  expect(std::isnan(v.temperature_C()) || (v.temperature_C() > -327.68 && v.temperature_C() <= 300.0));
  expect(v.brake_duty >= 0 && v.brake_duty <= 10000 && v.drive_duty >= 0 && v.drive_duty <= 10000);
  const bool fd = decoded.id == id::measurement;
  const std::int64_t most = std::int64_t{1} << (fd ? 31 : 23);
  expect(std::abs(v.upper_counts) <= most && std::abs(v.lower_counts) <= most);
  expect(std::abs(v.lever_counts) <= (fd ? most : 2048));
  const bool answer = fd || decoded.id == id::encoders || decoded.id == id::latch;
  if (answer) static_cast<void>(tracker.take(decoded.id, v));
}

/// The same bytes as datagrams of any size, through the socket that makes frames of them.
void through_socket(Input input, AnswerTracker& tracker) {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) return;
  FrameSocket socket(ends[0]);
  for (int i = 0; i < 8 && !input.empty(); ++i) {
    std::array<std::uint8_t, 80> datagram{};
    const std::uint8_t choice = input.byte();
    const std::size_t size = choice < 96 ? CAN_MTU : choice < 192 ? CANFD_MTU : choice % datagram.size() + 1;
    for (std::size_t at = 0; at < size; ++at) datagram[at] = input.byte();
    static_cast<void>(::send(ends[1], datagram.data(), size, MSG_DONTWAIT | MSG_NOSIGNAL));
    Frame frame;
    const bool came = socket.receive(frame, 0).ok();
    expect(came == (size == CAN_MTU || size == CANFD_MTU));
    if (!came) continue;
    expect(frame.length <= (frame.fd ? 64 : 8));
    if (frame.error) static_cast<void>(bus_report(frame));
    expect_in_range(decode(frame), tracker);
  }
  ::close(ends[1]);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  AnswerTracker tracker;
  tracker.expect(input.byte());
  through_socket(input, tracker);
  while (!input.empty()) {
    const Frame frame = frame_in(input);
    if (frame.error) static_cast<void>(bus_report(frame));
    expect_in_range(decode(frame), tracker);
  }
  return 0;
}

// Any frames at the emulated node's side of the bus: its outputs stay within [0, 1] and at zero unless it is active,
// and whatever it answers the driver's decoder takes. Input: records "kind, identifier, length, data ...".
#include <algorithm>
#include <cstdint>

#include "driver/can/protocol.hpp"
#include "emulator/can_node.hpp"
#include "fuzz_input.hpp"

namespace {

using namespace abs_hil;
using namespace abs_hil::fuzz;

emulator::BusFrame frame_in(Input& input) {
  const unsigned kind = input.byte();
  emulator::BusFrame frame{.id = 0x7FU + input.byte() % 5U, .fd = (kind & 1U) != 0};
  const unsigned own_length = frame.id == 0x80 ? 2 : 8;
  frame.length = static_cast<std::uint8_t>((kind & 2U) != 0 ? own_length : input.byte() % (frame.fd ? 65U : 9U));
  for (std::size_t i = 0; i < frame.length; ++i) frame.data[i] = input.byte();
  if ((kind & 4U) != 0 && frame.length > 0) frame.seal();
  return frame;
}

void check_answers(emulator::CanNode& node) {
  for (const emulator::BusFrame& answer : node.take_answers()) {
    driver::can::Frame frame{.id = answer.id, .length = answer.length, .fd = answer.fd};
    std::copy(answer.data.begin(), answer.data.end(), frame.data.begin());
    expect(driver::can::decode(frame).error == driver::can::DecodeError::none);
  }
  const emulator::Outputs out = node.outputs();
  expect(out.drive_duty >= 0.0 && out.drive_duty <= 1.0 && out.brake_duty >= 0.0 && out.brake_duty <= 1.0);
  expect(node.state() == emulator::CanNode::State::active || (out.drive_duty == 0.0 && out.brake_duty == 0.0));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  emulator::CanNode node({.start_speed_rad_s = 60.0});
  // Active from the start: the nonce that guards the activation is no riddle for a fuzzer to solve.
  emulator::BusFrame activation{.id = 0x82, .length = 8, .data = {2, 0x34, 0x12}};
  activation.seal();
  node.receive(activation);
  std::int64_t now_ns = 0;
  for (int i = 0; i < 64 && !input.empty(); ++i) {
    node.advance_to(now_ns += 10'000 * std::int64_t{input.byte()});
    node.receive(frame_in(input));
    check_answers(node);
  }
  return 0;
}

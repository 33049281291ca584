// Makes a CAN node safe from a second process.
#include "driver/can/can_safe_state.hpp"

#include "driver/can/can_driver.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver::can {

namespace {

constexpr std::int64_t answer_ns = 100'000'000;
constexpr std::int64_t look_ns = 5'000'000;

}  // namespace

std::int64_t CanSafeState::owner_needs_ns() const noexcept { return can_make_safe_bound_ns; }

IoResult CanSafeState::send_zeros() noexcept {
  const SendResult requested = handle_.socket->send(control_frame(Request::deactivate));
  // A node that missed the request, or does not obey it, still takes a command of zeros.
  const SendResult zeros = handle_.socket->send(frame_of(id::command, {}));
  for (const SendResult& result : {requested, zeros}) {
    if (result.outcome == SendOutcome::down || result.outcome == SendOutcome::failed) {
      return {IoError::disconnected, id::control, result.errno_value, rig::Reason::can_interface_down};
    }
  }
  return {};
}

IoResult CanSafeState::verify() noexcept {
  bool inactive = false;
  bool zero = false;
  const bool safe = handle_.socket->listen(monotonic_ns() + answer_ns, [&](const Frame& frame) {
    const Decoded decoded = decode(frame);
    if (decoded.id == id::status) inactive = decoded.values.state() == NodeState::inactive;
    if (decoded.id == id::outputs) zero = !decoded.values.any_duty();
    return inactive && zero;
  });
  return safe ? IoResult{} : IoResult{IoError::no_answer, id::control, 0, rig::Reason::can_node_silent};
}

IoResult CanSafeState::look() noexcept {
  IoResult seen{IoError::no_answer, id::sync};
  if (handle_.socket->send(frame_of(id::sync, {.sequence = ++sync_})).outcome != SendOutcome::sent) return seen;
  handle_.socket->listen(monotonic_ns() + look_ns, [&](const Frame& frame) {
    const Decoded decoded = decode(frame);
    const Values& told = decoded.values;
    if (commands_node(frame) || told.state() != NodeState::inactive || told.any_duty()) {
      seen = foreign_output(frame.id);
    } else if ((decoded.id == id::latch || decoded.id == id::measurement) && told.sequence == sync_) {
      seen = {};
    }
    return seen.error != IoError::no_answer;
  });
  return seen;
}

IoResult CanSafeState::write_zeros() noexcept {
  handle_.socket->drain();  // earlier frames must not count as the answer
  IoResult result = send_zeros();
  if (result.ok()) result = verify();
  if (!result.ok() && one_peer_) handle_ = {};
  return result;
}

}  // namespace abs_hil::driver::can

#include "driver/can/can_safe_state.hpp"

#include <variant>

#include "driver/can/can_driver.hpp"
#include "driver/monotonic_time.hpp"

namespace abs_hil::driver::can {

namespace {

constexpr std::int64_t answer_ns = 100'000'000;
constexpr std::int64_t look_ns = 5'000'000;
/// A flooded bus must not keep the next zeros back.
constexpr int most_frames_of_an_answer = 1000;

/// What a node that somebody activated tells of itself.
bool shows_activity(const NodeMessage& message) noexcept {
  if (const auto* status = std::get_if<StatusMessage>(&message)) return status->state != NodeState::inactive;
  if (const auto* latch = std::get_if<LatchMessage>(&message)) return latch->state != NodeState::inactive;
  if (const auto* outputs = std::get_if<OutputsMessage>(&message)) return outputs->applied != RawDuties{};
  const auto* measured = std::get_if<MeasurementMessage>(&message);
  return measured != nullptr && (measured->state != NodeState::inactive || measured->applied != RawDuties{});
}

/// True for the last frame of the answer to a SYNC.
bool ends_answer(const NodeMessage& message, std::uint8_t sync) noexcept {
  if (const auto* latch = std::get_if<LatchMessage>(&message)) return latch->sequence == sync;
  const auto* measured = std::get_if<MeasurementMessage>(&message);
  return measured != nullptr && measured->sequence == sync;
}

}  // namespace

std::int64_t CanSafeState::owner_needs_ns() const noexcept { return can_make_safe_bound_ns; }

IoResult CanSafeState::send_zeros() noexcept {
  const SendResult requested = handle_.socket->send(control_frame({.request = Request::deactivate}));
  // A node that missed the request, or does not obey it, still takes a command of zeros.
  const SendResult zeros = handle_.socket->send(command_frame({}));
  for (const SendResult& result : {requested, zeros}) {
    if (result.outcome == SendOutcome::down || result.outcome == SendOutcome::failed) {
      return {IoError::disconnected, id::control, result.errno_value, rig::Reason::can_interface_down};
    }
  }
  return {};
}

IoResult CanSafeState::verify() noexcept {
  const std::int64_t deadline_ns = monotonic_ns() + answer_ns;
  bool inactive = false;
  bool zero = false;
  Frame frame;
  for (int i = 0; i < most_frames_of_an_answer && !(inactive && zero); ++i) {
    const ReceiveOutcome outcome = handle_.socket->receive(frame, deadline_ns).outcome;
    if (outcome == ReceiveOutcome::malformed) continue;
    if (outcome != ReceiveOutcome::frame) break;
    const Decoded decoded = decode(frame);
    if (const auto* status = std::get_if<StatusMessage>(&decoded.message)) {
      inactive = status->state == NodeState::inactive;
    } else if (const auto* outputs = std::get_if<OutputsMessage>(&decoded.message)) {
      zero = outputs->applied == RawDuties{};
    }
  }
  if (inactive && zero) return {};
  return {IoError::no_answer, id::control, 0, rig::Reason::can_node_silent};
}

IoResult CanSafeState::look() noexcept {
  if (handle_.socket->send(sync_frame(++sync_)).outcome != SendOutcome::sent) return {IoError::no_answer, id::sync};
  const std::int64_t deadline_ns = monotonic_ns() + look_ns;
  Frame frame;
  for (int i = 0; i < most_frames_of_an_answer; ++i) {
    const ReceiveOutcome outcome = handle_.socket->receive(frame, deadline_ns).outcome;
    if (outcome == ReceiveOutcome::malformed) continue;
    if (outcome != ReceiveOutcome::frame) break;
    const Decoded decoded = decode(frame);
    if (commands_node(frame) || shows_activity(decoded.message)) {
      return foreign_output(frame.id);
    }
    if (ends_answer(decoded.message, sync_)) return {};
  }
  return {IoError::no_answer, id::sync};
}

IoResult CanSafeState::write_zeros() noexcept {
  handle_.socket->drain();  // earlier frames must not count as the answer
  IoResult result = send_zeros();
  if (result.ok()) result = verify();
  if (!result.ok() && one_peer_) handle_ = {};
  return result;
}

}  // namespace abs_hil::driver::can

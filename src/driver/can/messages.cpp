#include "driver/can/messages.hpp"

#include <limits>

#include "driver/can/signal_codec.hpp"

namespace abs_hil::driver::can {

namespace {

namespace s = signal;

constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

/// A frame under construction.
class Building {
 public:
  Building(std::uint32_t identifier, std::uint8_t bytes) noexcept {
    frame_.id = identifier;
    frame_.length = bytes;
  }
  template <typename Raw>
  Building& set(const Signal& signal, Raw raw) noexcept {
    set_raw_value(frame_, signal, static_cast<std::int64_t>(raw));
    return *this;
  }
  [[nodiscard]] Frame with_check() noexcept {
    frame_.data[frame_.length - 1U] = checksum(frame_);
    return frame_;
  }

 private:
  Frame frame_{};
};

template <typename Target>
Target get(const Frame& frame, const Signal& signal) noexcept {
  return static_cast<Target>(raw_value(frame, signal));
}

double physical_or_nan(const Frame& frame, const Signal& signal, std::int64_t unknown) noexcept {
  const std::int64_t raw = raw_value(frame, signal);
  return raw == unknown ? not_known : physical_value(signal, raw);
}

RawDuties duties(const Frame& frame, const Signal& brake, const Signal& drive) noexcept {
  return {.brake = get<std::uint16_t>(frame, brake), .drive = get<std::uint16_t>(frame, drive)};
}

StatusMessage status_in(const Frame& f) noexcept {
  return {.trip_flags = get<std::uint32_t>(f, s::trip_flags),
          .state = get<NodeState>(f, s::node_state),
          .latch_reason = get<LatchReason>(f, s::latch_reason),
          .supply_V = physical_or_nan(f, s::supply, supply_unknown),
          .temperature_C = physical_or_nan(f, s::temperature, temperature_unknown),
          .sequence = get<std::uint8_t>(f, s::sequence_of_8)};
}

OutputsMessage outputs_in(const Frame& f) noexcept {
  return {.applied = duties(f, s::brake_applied, s::drive_applied),
          .rejected = get<std::uint8_t>(f, s::rejected_commands),
          .command_sequence = get<std::uint8_t>(f, s::command_sequence),
          .sequence = get<std::uint8_t>(f, s::sequence_of_8)};
}

EncodersMessage encoders_in(const Frame& f) noexcept {
  return {.upper_counts = get<std::int32_t>(f, s::upper_counts),
          .lower_counts = get<std::int32_t>(f, s::lower_counts),
          .sequence = get<std::uint8_t>(f, s::sequence_of_8)};
}

LatchMessage latch_in(const Frame& f) noexcept {
  return {.node_time_us = get<std::uint32_t>(f, s::node_time),
          .lever_counts = get<std::int32_t>(f, s::lever_counts),
          .state = get<NodeState>(f, s::latch_state),
          .sequence = get<std::uint8_t>(f, s::sequence_of_8)};
}

MeasurementMessage measurement_in(const Frame& f) noexcept {
  return {.upper_counts = get<std::int32_t>(f, s::fd_upper_counts),
          .lower_counts = get<std::int32_t>(f, s::fd_lower_counts),
          .lever_counts = get<std::int32_t>(f, s::fd_lever_counts),
          .node_time_us = get<std::uint32_t>(f, s::fd_node_time),
          .applied = duties(f, s::fd_brake_applied, s::fd_drive_applied),
          .trip_flags = get<std::uint32_t>(f, s::fd_trip_flags),
          .state = get<NodeState>(f, s::fd_node_state),
          .command_sequence = get<std::uint8_t>(f, s::fd_command_sequence),
          .sequence = get<std::uint8_t>(f, s::fd_sequence)};
}

IdentityMessage identity_in(const Frame& f) noexcept {
  return {.protocol = get<std::uint8_t>(f, s::protocol),
          .features = get<std::uint8_t>(f, s::features),
          .nonce = get<std::uint16_t>(f, s::identity_nonce),
          .watchdog_ms = get<std::uint16_t>(f, s::identity_watchdog)};
}

NodeMessage message_in(const Frame& frame) noexcept {
  switch (frame.id) {
    case id::status: return status_in(frame);
    case id::outputs: return outputs_in(frame);
    case id::encoders: return encoders_in(frame);
    case id::latch: return latch_in(frame);
    case id::measurement: return measurement_in(frame);
    case id::identity: return identity_in(frame);
    default: return std::monostate{};
  }
}

}  // namespace

Frame time_frame(std::int64_t host_time_ns) noexcept {
  return Building(id::time, 8).set(s::host_time, host_time_ns).with_check();
}

Frame sync_frame(std::uint8_t sequence) noexcept {
  return Building(id::sync, 2).set(s::sync_sequence, sequence).with_check();
}

Frame command_frame(const CommandMessage& command) noexcept {
  return Building(id::command, 8)
      .set(s::brake_duty, command.duties.brake)
      .set(s::drive_duty, command.duties.drive)
      .set(s::drive_enable, command.drive_enable)
      .set(s::heartbeat, command.heartbeat)
      .set(s::sequence_of_8, command.sequence)
      .with_check();
}

Frame control_frame(const ControlMessage& control) noexcept {
  return Building(id::control, 8)
      .set(s::request, control.request)
      .set(s::control_nonce, control.nonce)
      .set(s::watchdog_timeout, control.watchdog_ms)
      .set(s::sequence_of_8, control.sequence)
      .with_check();
}

bool commands_node(const Frame& frame) noexcept {
  const bool asks_only = frame.data[0] == static_cast<std::uint8_t>(Request::identify);
  return !frame.error && (frame.id == id::command || (frame.id == id::control && !asks_only));
}

Decoded decode(const Frame& frame) noexcept {
  const Message* message = frame.error ? nullptr : find_message(frame.id);
  if (message == nullptr || !message->from_node) return {DecodeError::unknown_identifier, {}};
  if (frame.length != message->bytes || (message->fd_only && !frame.fd)) return {DecodeError::wrong_length, {}};
  if (frame.data[frame.length - 1U] != checksum(frame)) return {DecodeError::wrong_check, {}};
  for (const Signal& signal : message->signals) {
    if (!in_range(signal, raw_value(frame, signal))) return {DecodeError::out_of_range, {}};
  }
  return {DecodeError::none, message_in(frame)};
}

}  // namespace abs_hil::driver::can

#pragma once

#include <cstdint>
#include <variant>

#include "driver/can/frame.hpp"
#include "driver/can/protocol.hpp"

namespace abs_hil::driver::can {

// Messages that the host sends, as frames with checksum.

[[nodiscard]] Frame time_frame(std::int64_t host_time_ns) noexcept;
[[nodiscard]] Frame sync_frame(std::uint8_t sequence) noexcept;

/// Duties in steps of 0.0001.
struct RawDuties {
  std::uint16_t brake{0};
  std::uint16_t drive{0};
  [[nodiscard]] bool operator==(const RawDuties&) const = default;
};
struct CommandMessage {
  RawDuties duties{};
  bool drive_enable{false};
  std::uint8_t heartbeat{0};  ///< sequence of the measurement from which the command was computed
  std::uint8_t sequence{0};
};
[[nodiscard]] Frame command_frame(const CommandMessage& command) noexcept;

struct ControlMessage {
  Request request{Request::identify};
  std::uint16_t nonce{0};        ///< of the node's latest ABS_IDENTITY
  std::uint16_t watchdog_ms{0};  ///< 0: unchanged
  std::uint8_t sequence{0};      ///< the first command has the next sequence
};
[[nodiscard]] Frame control_frame(const ControlMessage& control) noexcept;

/// True for a frame that commands the node, whether or not the node takes it. Received, it is from another sender: a
/// socket does not receive its own frames. Real-time safe.
[[nodiscard]] bool commands_node(const Frame& frame) noexcept;

// Messages that the node sends. Every field is within its signal's range.

struct StatusMessage {
  std::uint32_t trip_flags{0};
  NodeState state{NodeState::inactive};
  LatchReason latch_reason{LatchReason::none};
  double supply_V{0.0};       ///< NaN: the node does not know it
  double temperature_C{0.0};  ///< NaN: the node does not know it
  std::uint8_t sequence{0};   ///< of the SYNC that it answers
};
struct OutputsMessage {
  RawDuties applied{};
  std::uint8_t rejected{0};          ///< commands rejected since power-on, modulo 256
  std::uint8_t command_sequence{0};  ///< of the last command accepted
  std::uint8_t sequence{0};
};
struct EncodersMessage {
  std::int32_t upper_counts{0};  ///< 24 bits, wrapping
  std::int32_t lower_counts{0};
  std::uint8_t sequence{0};
};
struct LatchMessage {
  std::uint32_t node_time_us{0};  ///< node's clock at the moment when it latched the counters
  std::int32_t lever_counts{0};   ///< 12 bits, wrapping
  NodeState state{NodeState::inactive};
  std::uint8_t sequence{0};
};
/// CAN FD: encoders, latch and outputs in one message.
struct MeasurementMessage {
  std::int32_t upper_counts{0};
  std::int32_t lower_counts{0};
  std::int32_t lever_counts{0};
  std::uint32_t node_time_us{0};
  RawDuties applied{};
  std::uint32_t trip_flags{0};
  NodeState state{NodeState::inactive};
  std::uint8_t command_sequence{0};
  std::uint8_t sequence{0};
};
struct IdentityMessage {
  std::uint8_t protocol{0};
  std::uint8_t features{0};
  std::uint16_t nonce{0};
  std::uint16_t watchdog_ms{0};
};

enum class DecodeError : std::uint8_t {
  none = 0,
  unknown_identifier,  ///< not a message of the node
  wrong_length,        ///< wrong length, or wrong format (classic, FD) for this message
  wrong_check,         ///< wrong checksum: the frame is damaged or from another protocol
  out_of_range,        ///< the value of a signal is outside its range
};

using NodeMessage = std::variant<std::monostate, StatusMessage, OutputsMessage, EncodersMessage, LatchMessage,
                                 MeasurementMessage, IdentityMessage>;

struct Decoded {
  DecodeError error{DecodeError::none};
  NodeMessage message{};  ///< monostate on error
};
/// Decodes any frame to a message of the node, or to an error. Real-time safe.
[[nodiscard]] Decoded decode(const Frame& frame) noexcept;

}  // namespace abs_hil::driver::can

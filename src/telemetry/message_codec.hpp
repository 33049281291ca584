#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/command_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/measurement_t.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"

namespace abs_hil::telemetry {

/// The record as a message. `distance_m`: the car's way since braking started; `sequence`: of the channel.
[[nodiscard]] telemetry_t to_message(const rig::CycleRecord& record, double distance_m, std::int64_t sequence) noexcept;

/// The inverse of to_message, as far as the message goes: the command's torque and true speeds handed to the controller
/// are not in it, and the counters' time is the stamp (measurement_t says otherwise where it is not).
[[nodiscard]] rig::CycleRecord to_record(const telemetry_t& message) noexcept;
/// The record's cycle and the time of its counters.
[[nodiscard]] measurement_t measured_at(const rig::CycleRecord& record) noexcept;

/// A buffer that messages are encoded into; it grows to the largest and allocates no more after that.
class EncodeBuffer {
 public:
  explicit EncodeBuffer(std::size_t initial_bytes = 512) : bytes_(initial_bytes) {}

  /// Bytes of `message`, valid until the next call. Throws std::length_error for one beyond LCM's size limit.
  template <class Message>
  [[nodiscard]] std::span<const std::uint8_t> encode(const Message& message) {
    const int size = message.getEncodedSize();
    if (size < 0) throw std::length_error("LCM message too large");
    if (static_cast<std::size_t>(size) > bytes_.size()) bytes_.resize(static_cast<std::size_t>(size));
    // May be shorter than announced: lcm-gen's strings end at their first NUL.
    const int written = message.encode(bytes_.data(), 0, size);
    if (written < 0) throw std::length_error("LCM message could not be encoded");
    return {bytes_.data(), static_cast<std::size_t>(written)};
  }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// Result of decoding what came in on ABS_COMMAND: `problem` is empty if `command` is valid, else says why not.
struct DecodedCommand {
  command_t command{};
  std::string_view problem{};
};

/// decode_checked for command_t.
[[nodiscard]] DecodedCommand decode_command(std::span<const std::uint8_t> packet);

/// `text` cut to `max_bytes` with control and non-ASCII bytes replaced by '?', fit for logs and terminals.
[[nodiscard]] std::string printable(std::string_view text, std::size_t max_bytes);

}  // namespace abs_hil::telemetry

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
#include "abs_hil/signals_t.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"

namespace abs_hil::telemetry {

/// The record as a message. `distance_m`: distance of the car since braking started; `sequence`: of the channel.
[[nodiscard]] telemetry_t to_message(const rig::CycleRecord& record, double distance_m, std::int64_t sequence) noexcept;

/// The inverse of to_message for the fields of the message. The message lacks the command's torque and the true speeds
/// given to the controller. The time of the counters is the stamp, unless a measurement_t gives another time.
[[nodiscard]] rig::CycleRecord to_record(const telemetry_t& message) noexcept;
/// The record's cycle and the time of its counters.
[[nodiscard]] measurement_t measured_at(const rig::CycleRecord& record) noexcept;

/// Fills in the cycle and the first `count` values; the others are NaN, and `names` stays.
void put_signals(const rig::CycleRecord& record, std::size_t count, signals_t& message) noexcept;
/// The values of the message.
[[nodiscard]] rig::SignalValues signals_of(const signals_t& message) noexcept;

/// A buffer for encoding. It grows to the size of the largest message and allocates nothing after that.
class EncodeBuffer {
 public:
  explicit EncodeBuffer(std::size_t initial_bytes = 512) : bytes_(initial_bytes) {}

  /// Encodes `message`. The bytes are valid until the next call. Throws std::length_error above LCM's size limit.
  template <class Message>
  [[nodiscard]] std::span<const std::uint8_t> encode(const Message& message) {
    const int size = message.getEncodedSize();
    if (size < 0) throw std::length_error("the message is larger than LCM's limit");
    if (static_cast<std::size_t>(size) > bytes_.size()) bytes_.resize(static_cast<std::size_t>(size));
    // The size may be smaller than announced, because strings of lcm-gen end at their first NUL.
    const int written = message.encode(bytes_.data(), 0, size);
    if (written < 0) throw std::length_error("LCM cannot encode the message");
    return {bytes_.data(), static_cast<std::size_t>(written)};
  }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// A decoded message of ABS_COMMAND. `problem` is empty if `command` is valid; otherwise it gives the reason.
struct DecodedCommand {
  command_t command{};
  std::string_view problem{};
};

/// decode_checked for command_t.
[[nodiscard]] DecodedCommand decode_command(std::span<const std::uint8_t> packet);

}  // namespace abs_hil::telemetry

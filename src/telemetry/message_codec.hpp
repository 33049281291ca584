#pragma once

// A cycle's record as a telemetry message, and back.

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::telemetry {

/// A message with the names of its values, for put_record.
[[nodiscard]] telemetry_t blank_message(const rig::RunNames& names);
/// Fills in the record; sequence, stamp of the channel and names stay. `message` is of blank_message with these names.
void put_record(const rig::CycleRecord& record, double distance_m, const rig::RunNames& names, telemetry_t& message);
/// Both at once. `distance_m`: distance of the car since braking started; `sequence`: of the channel.
[[nodiscard]] telemetry_t to_message(const rig::CycleRecord& record, double distance_m, std::int64_t sequence,
                                     const rig::RunNames& names = {});

/// The inverse of put_record: each message is a whole row. The message lacks the command's torque and the true speeds
/// given to the controller. What the message of another version lacks (`lacking_in`) is NaN, or 0 if it is no double.
[[nodiscard]] rig::CycleRecord to_record(const telemetry_t& message);

/// A value of `values` and its name; the name is a part of the message.
struct NamedValue {
  std::string_view name;
  double value{rig::unknown};
};
[[nodiscard]] std::vector<NamedValue> values_of(const telemetry_t& message);
/// Names of the controller's own signals in the message.
[[nodiscard]] std::vector<std::string> signals_of(const telemetry_t& message);
/// Quantities of this version's table that the message lacks, because another version sent it.
[[nodiscard]] std::vector<std::string_view> lacking_in(const telemetry_t& message);

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

/// Two digits a byte, letters small.
[[nodiscard]] inline std::string hexadecimal(std::span<const std::uint8_t> bytes) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : bytes) {
    text += digits[byte >> 4U];
    text += digits[byte & 0xFU];
  }
  return text;
}

}  // namespace abs_hil::telemetry

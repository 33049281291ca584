// A cycle's record as a telemetry message, and back.
#pragma once

#include <boost/endian/conversion.hpp>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "abs_hil/message_fields.hpp"
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

/// Reads LCM's big-endian fields one by one, never beyond the end. After a field that does not fit it reads nothing.
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::uint8_t> packet) : rest_(packet) {}

  template <class Number>
    requires std::is_arithmetic_v<Number>
  void operator()(std::string_view /*name*/, Number& value) {
    const std::uint8_t* const bytes = take(sizeof value);
    if (bytes == nullptr) return;
    value = boost::endian::endian_load<Number, sizeof value, boost::endian::order::big>(bytes);
    if constexpr (std::is_integral_v<Number> && sizeof value == sizeof(std::int32_t))
      last_whole_ = static_cast<std::int32_t>(value);
  }
  /// The length is the field before, an int32_t (lcmtypes/message_fields.py).
  void operator()(std::string_view name, std::vector<double>& values) {
    sound_ = sound_ && last_whole_ >= 0 && static_cast<std::uint64_t>(last_whole_) <= rest_.size() / sizeof(double);
    if (!sound_) return;
    values.resize(static_cast<std::size_t>(last_whole_));
    for (double& value : values) (*this)(name, value);
  }
  /// A string is its length with the final NUL, then its bytes with the NUL.
  void operator()(std::string_view /*name*/, std::string& value) {
    const std::uint8_t* const bytes = take(sizeof(std::int32_t));
    if (bytes == nullptr) return;
    const std::size_t length = boost::endian::load_big_u32(bytes);
    sound_ = length > 0 && length <= rest_.size() && rest_[length - 1] == 0;
    if (!sound_) return;
    value.assign(reinterpret_cast<const char*>(rest_.data()), length - 1);
    // A NUL within: the generated encoder would cut the text there.
    sound_ = value.find('\0') == std::string::npos;
    rest_ = rest_.subspan(length);
  }
  [[nodiscard]] bool sound() const noexcept { return sound_; }
  [[nodiscard]] bool at_end() const noexcept { return rest_.empty(); }

 private:
  /// The next bytes; null where they do not fit.
  const std::uint8_t* take(std::size_t bytes) {
    sound_ = sound_ && rest_.size() >= bytes;
    if (!sound_) return nullptr;
    const std::uint8_t* const taken = rest_.data();
    rest_ = rest_.subspan(bytes);
    return taken;
  }

  std::span<const std::uint8_t> rest_;
  std::int32_t last_whole_{0};
  bool sound_{true};
};

/// The fingerprint at the start of a packet; 0 if the packet is too short.
[[nodiscard]] inline std::int64_t fingerprint_of(std::span<const std::uint8_t> packet) {
  std::int64_t fingerprint = 0;
  FieldReader reader(packet);
  reader("fingerprint", fingerprint);
  return fingerprint;
}

/// Decodes a packet from an untrusted source. The generated decode() trusts lengths: a string of length 0 or less
/// throws or worse. This function checks every length first. Returns the problem, or an empty text if `message` is
/// valid. Do not use the fields of an invalid message. Throws only std::bad_alloc.
template <class Message>
[[nodiscard]] std::string_view decode_checked(std::span<const std::uint8_t> packet, Message& message) {
  if (packet.size() < sizeof(std::int64_t)) return "shorter than a fingerprint";
  if (fingerprint_of(packet) != static_cast<std::int64_t>(Message::getHash()))
    return "wrong fingerprint: it is of another type or of another version's type";
  FieldReader reader(packet.subspan(sizeof(std::int64_t)));
  visit_fields(message, reader);
  if (!reader.sound()) return "truncated or damaged";
  if (!reader.at_end()) return "longer than its type";
  return {};
}

}  // namespace abs_hil::telemetry

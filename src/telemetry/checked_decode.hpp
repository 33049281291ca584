#pragma once

#include <boost/endian/conversion.hpp>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "abs_hil/message_fields.hpp"

namespace abs_hil::telemetry {

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

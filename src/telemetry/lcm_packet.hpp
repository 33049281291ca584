#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace abs_hil::telemetry {

/// The kind of a datagram of LCM's UDP multicast, for a reader of one channel that takes whole messages only.
struct LcmPacket {
  enum class Kind : std::uint8_t {
    other,       ///< of another channel, the rest of a fragmented message, or not LCM
    message,     ///< a whole message of the channel
    fragmented,  ///< the beginning of a message of the channel that did not fit one datagram
  };
  Kind kind{Kind::other};
  std::span<const std::uint8_t> payload{};  ///< of a message: the encoded type, within the datagram
};

/// Largest size before the payload, bytes: header, longest channel name and its NUL.
inline constexpr std::size_t lcm_packet_overhead_max = 20 + 63 + 1;

/// Reads LCM's own framing, big-endian: 'LC02', message number, channel, NUL, payload; a message of several datagrams
/// has 'LC03' instead, and its first datagram has size, offset and count before the channel. Any bytes are allowed.
[[nodiscard]] LcmPacket look_at(std::span<const std::uint8_t> datagram, std::string_view channel) noexcept;

}  // namespace abs_hil::telemetry

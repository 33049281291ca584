#include "telemetry/lcm_packet.hpp"

#include <algorithm>

namespace abs_hil::telemetry {
namespace {

constexpr std::uint32_t whole_magic = 0x4C433032;
constexpr std::uint32_t fragment_magic = 0x4C433033;
constexpr std::size_t whole_header_bytes = 8;
constexpr std::size_t fragment_header_bytes = 20;
constexpr std::size_t fragment_number_at = 16;

std::uint32_t word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t word = 0;
  for (const std::uint8_t byte : bytes.subspan(at, sizeof word)) word = word << 8U | byte;
  return word;
}

/// The bytes after `channel` and its NUL; null if the datagram has another channel.
const std::uint8_t* after_channel(std::span<const std::uint8_t> bytes, std::string_view channel) {
  if (bytes.size() <= channel.size() || bytes[channel.size()] != 0) return nullptr;
  const auto same = [](char c, std::uint8_t byte) { return static_cast<std::uint8_t>(c) == byte; };
  if (!std::equal(channel.begin(), channel.end(), bytes.begin(), same)) return nullptr;
  return bytes.data() + channel.size() + 1;
}

}  // namespace

LcmPacket look_at(std::span<const std::uint8_t> datagram, std::string_view channel) noexcept {
  if (datagram.size() < whole_header_bytes) return {};
  const std::uint32_t magic = word_at(datagram, 0);
  if (magic == whole_magic) {
    const std::uint8_t* payload = after_channel(datagram.subspan(whole_header_bytes), channel);
    if (payload == nullptr) return {};
    return {LcmPacket::Kind::message, {payload, datagram.data() + datagram.size()}};
  }
  if (magic != fragment_magic || datagram.size() < fragment_header_bytes) return {};
  const bool first = datagram[fragment_number_at] == 0 && datagram[fragment_number_at + 1] == 0;
  if (!first || after_channel(datagram.subspan(fragment_header_bytes), channel) == nullptr) return {};
  return {LcmPacket::Kind::fragmented, {}};
}

}  // namespace abs_hil::telemetry

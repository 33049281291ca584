// What anybody may send: every decoder of ours on the same bytes, and the reader of LCM's own framing. A packet that is
// taken must come out of the encoder as it came in; a payload must lie within its datagram.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "commands/receiver.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/message_codec.hpp"

using namespace abs_hil;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  // The fingerprint is a wall that chance does not pass: the first byte chooses the type instead.
  int type = 0;
  telemetry::for_each_message_type([&]<class Message>() {
    if (type++ != data[0] % 7) return;
    std::vector<std::uint8_t> packet;
    const auto fingerprint = static_cast<std::uint64_t>(Message::getHash());
    for (int shift = 56; shift >= 0; shift -= 8) packet.push_back(static_cast<std::uint8_t>(fingerprint >> shift));
    packet.insert(packet.end(), data + 1, data + size);
    Message message{};
    if (!telemetry::decode_checked(packet, message).empty()) return;
    telemetry::EncodeBuffer buffer;
    const auto again = buffer.encode(message);
    if (!std::equal(again.begin(), again.end(), packet.begin(), packet.end())) std::abort();
  });
  const std::span<const std::uint8_t> raw(data, size);
  command_t command{};
  if (telemetry::decode_checked(raw, command).empty() && command.command.size() > size) std::abort();
  static_cast<void>(rig::clean_text(command.sender, 64));

  // As it came, and behind each magic word, which chance does not pass either.
  for (const char magic : {'\0', '2', '3'}) {
    std::vector<std::uint8_t> datagram(raw.begin(), raw.end());
    if (magic != '\0') datagram.insert(datagram.begin(), {'L', 'C', '0', static_cast<std::uint8_t>(magic)});
    const auto packet = commands::look_at(datagram, "ABS_COMMAND");
    const bool message = packet.kind == commands::LcmPacket::Kind::message;
    if (message != (packet.payload.data() != nullptr)) std::abort();
    if (!message) continue;
    const std::uint8_t* const end = datagram.data() + datagram.size();
    if (packet.payload.data() < datagram.data() || packet.payload.data() + packet.payload.size() != end) std::abort();
  }
  return 0;
}

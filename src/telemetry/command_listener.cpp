#include "abs_hil/telemetry/command_listener.hpp"

#include <poll.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

namespace abs_hil::telemetry {
namespace {

constexpr int packets_per_poll = 32;
constexpr int answers_per_second = 10;
constexpr std::size_t shown_text_max_bytes = 64;

}  // namespace

CommandListener::CommandListener(LcmOutlet& outlet, MessageStream& stream, std::function<void()> on_stop)
    : outlet_(outlet), stream_(stream), on_stop_(std::move(on_stop)) {
  // A log file has nothing to say, and its descriptor for waiting is not one to poll.
  if (outlet_.provider() == "file") return;
  subscription_ = lcm_subscribe(outlet_.lcm().getUnderlyingLCM(), stream_.command_channel().c_str(), &on_packet, this);
}

CommandListener::~CommandListener() {
  if (subscription_ != nullptr) lcm_unsubscribe(outlet_.lcm().getUnderlyingLCM(), subscription_);
}

void CommandListener::poll() {
  if (subscription_ == nullptr) return;
  for (int i = 0; i < packets_per_poll; ++i) {
    // Not lcm_handle_timeout: its select() does not survive descriptors of -1 (tcpq without server) or above 1023.
    pollfd ready{outlet_.lcm().getFileno(), POLLIN, 0};
    if (ready.fd < 0 || ::poll(&ready, 1, 0) <= 0 || outlet_.lcm().handle() != 0) return;
    if (!std::exchange(packet_.arrived, false)) continue;
    if (packet_.size > packet_.bytes.size()) {
      ++counts_.malformed;
      answer(rig::Reason::none, "refused a packet: too long for a command", counts_.malformed);
    } else {
      take(std::span(packet_.bytes).first(packet_.size));
    }
  }
}

// Only copies: answers are published, and may throw, outside of LCM's C code.
void CommandListener::on_packet(const lcm_recv_buf_t* received, const char* /*channel*/, void* self) noexcept {
  Packet& packet = static_cast<CommandListener*>(self)->packet_;
  packet.size = received->data_size;
  packet.arrived = true;
  if (packet.size <= packet.bytes.size()) std::memcpy(packet.bytes.data(), received->data, packet.size);
}

void CommandListener::take(std::span<const std::uint8_t> packet) {
  const auto [command, problem] = decode_command(packet);
  if (!problem.empty()) {
    ++counts_.malformed;
    answer(rig::Reason::none, std::string("refused a packet: ").append(problem), counts_.malformed);
    return;
  }
  const std::string token = " (token '" + printable(command.token, shown_text_max_bytes) + "')";
  if (command.command == "stop") {
    ++counts_.stops;
    if (on_stop_) on_stop_();
    answer(rig::Reason::stop_command, "stop accepted" + token, counts_.stops);
    return;
  }
  ++counts_.refused;
  answer(rig::Reason::none,
         "refused '" + printable(command.command, shown_text_max_bytes) + "': only 'stop' is accepted" + token,
         counts_.refused);
}

void CommandListener::answer(rig::Reason reason, std::string message, std::uint64_t count) {
  const double now_s = stream_.time_s();
  if (now_s - answer_window_start_s_ >= 1.0) {
    answer_window_start_s_ = now_s;
    answers_in_window_ = 0;
  }
  // A flood must not get a flood of answers; the first stop is answered whatever came before.
  const bool first_stop = reason == rig::Reason::stop_command && count == 1;
  if (!first_stop && answers_in_window_ >= answers_per_second) return;
  ++answers_in_window_;
  stream_.answer_command(reason, std::move(message), static_cast<double>(count));
}

}  // namespace abs_hil::telemetry

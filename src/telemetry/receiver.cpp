// Receives what other programs publish over LCM, and finds a tcpq server again that restarts.
#include "telemetry/receiver.hpp"

#include <poll.h>

#include <new>
#include <utility>

#include "telemetry/lcm_url.hpp"

namespace abs_hil::telemetry {
namespace {

/// LCM's queue holds 30 messages by default, which is 30 ms of telemetry.
constexpr int queue_messages = 20'000;
constexpr std::chrono::seconds look_period{1};
constexpr int look_timeout_ms = 100;

std::string well_formed(std::string url) {
  if (!url.empty()) static_cast<void>(parse_lcm_url(url));  // wrong input, not a missing network
  return url;
}

}  // namespace

Receiver::Receiver(std::string url, std::string channels, Take take)
    : own_(std::in_place, well_formed(std::move(url))),
      network_(*own_),
      channels_(std::move(channels)),
      take_(std::move(take)) {
  subscribe();
}

Receiver::Receiver(LcmOutlet& network, std::string channels, Take take)
    : network_(network), channels_(std::move(channels)), take_(std::move(take)) {
  subscribe();
}

Receiver::~Receiver() {
  // A network of its own unsubscribes by itself; with tcpq an explicit call would search for the server again.
  if (!own_) lcm_unsubscribe(network_.lcm().getUnderlyingLCM(), subscription_);
}

void Receiver::subscribe() {
  subscription_ = lcm_subscribe(network_.lcm().getUnderlyingLCM(), channels_.c_str(), &on_packet, this);
  if (subscription_ == nullptr) {
    throw LcmError("LCM cannot subscribe to the channels \"" + channels_ + "\" at '" + network_.url() + "'");
  }
  lcm_subscription_set_queue_capacity(subscription_, queue_messages);
}

void Receiver::look_for_server() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_look_) return;
  next_look_ = now + look_period;
  if (ask_tcpq_server(endpoint_of(parse_lcm_url(network_.url())), look_timeout_ms) != TcpqServer::answers) return;
  // This connects again. lcm_handle would connect too, but then wait for a message without limit.
  lcm_unsubscribe(network_.lcm().getUnderlyingLCM(), subscription_);
  subscribe();
}

void Receiver::on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept {
  Receiver& receiver = *static_cast<Receiver*>(self);
  // No exception may pass through LCM's C code.
  try {
    receiver.take_(channel, {static_cast<const std::uint8_t*>(received->data), received->data_size});
  } catch (const std::bad_alloc&) {
    receiver.out_of_memory_ = true;
  }
}

void Receiver::poll(int packets_max) {
  for (int i = 0; i < packets_max; ++i) {
    // Not lcm_handle_timeout: its select() does not survive descriptors of -1 (tcpq without server) or above 1023.
    pollfd ready{file_descriptor(), POLLIN, 0};
    if (ready.fd < 0) return look_for_server();
    if (::poll(&ready, 1, 0) <= 0) return;
    const bool handled = network_.lcm().handle() == 0;
    if (std::exchange(out_of_memory_, false)) throw std::bad_alloc();
    if (!handled) return;
  }
}

}  // namespace abs_hil::telemetry

#include "telemetry/run_listener.hpp"

#include <poll.h>

#include <chrono>
#include <cstdint>
#include <new>
#include <span>
#include <utility>

#include "telemetry/checked_decode.hpp"
#include "telemetry/lcm_url.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/tcpq_server.hpp"

namespace abs_hil::telemetry {
namespace {

/// LCM's queue holds 30 messages by default, which is 30 ms of telemetry.
constexpr int queue_messages = 20'000;
constexpr std::chrono::seconds look_period{1};
constexpr int look_timeout_ms = 100;

}  // namespace

RunListener::RunListener(std::string url, const std::string& channel_prefix, RunObserver& observer)
    : network_(std::move(url)), observer_(observer), prefix_(channel_prefix) {
  check_channel_prefix(prefix_);
  subscribe();
}

void RunListener::subscribe() {
  subscribe<telemetry_t>(prefix_ + "TELEMETRY");
  subscribe<status_t>(prefix_ + "STATUS");
  subscribe<event_t>(prefix_ + "EVENT");
  subscribe<experiment_t>(prefix_ + "EXPERIMENT");
}

void RunListener::look_for_server() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_look_) return;
  next_look_ = now + look_period;
  if (ask_tcpq_server(endpoint_of(parse_lcm_url(network_.url())), look_timeout_ms) != TcpqServer::answers) return;
  // This connects again. lcm_handle would connect too, but then wait for a message without limit.
  for (lcm_subscription_t* subscription : subscriptions_) {
    lcm_unsubscribe(network_.lcm().getUnderlyingLCM(), subscription);
  }
  subscriptions_.clear();
  subscribe();
}

template <class Message>
void RunListener::subscribe(const std::string& channel) {
  lcm_subscription_t* subscription =
      lcm_subscribe(network_.lcm().getUnderlyingLCM(), channel.c_str(), &on_packet<Message>, this);
  if (subscription == nullptr) throw LcmError("LCM cannot subscribe to " + channel + " at '" + network_.url() + "'");
  lcm_subscription_set_queue_capacity(subscription, queue_messages);
  subscriptions_.push_back(subscription);
}

template <class Message>
void RunListener::on_packet(const lcm_recv_buf_t* received, const char* /*channel*/, void* self) noexcept {
  RunListener& listener = *static_cast<RunListener*>(self);
  // No exception may pass through LCM's C code.
  try {
    Message message{};
    const std::span packet(static_cast<const std::uint8_t*>(received->data), received->data_size);
    if (decode_checked(packet, message).empty()) {
      listener.observer_.take(message);
    } else {
      listener.observer_.take_malformed();
    }
  } catch (const std::bad_alloc&) {
    listener.out_of_memory_ = true;
  }
}

void RunListener::poll(int messages_max) {
  for (int i = 0; i < messages_max; ++i) {
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

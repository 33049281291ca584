#include "abs_hil/telemetry/run_listener.hpp"

#include <poll.h>

#include <cstdint>
#include <new>
#include <span>
#include <utility>

#include "abs_hil/telemetry/checked_decode.hpp"
#include "abs_hil/telemetry/message_stream.hpp"

namespace abs_hil::telemetry {
namespace {

/// LCM's queue holds 30 messages, 30 ms of telemetry, if nobody says otherwise.
constexpr int queue_messages = 20'000;

}  // namespace

RunListener::RunListener(std::string url, const std::string& channel_prefix, RunObserver& observer)
    : network_(std::move(url)), observer_(observer) {
  check_channel_prefix(channel_prefix);
  subscribe<telemetry_t>(channel_prefix + "TELEMETRY");
  subscribe<status_t>(channel_prefix + "STATUS");
  subscribe<event_t>(channel_prefix + "EVENT");
  subscribe<experiment_t>(channel_prefix + "EXPERIMENT");
}

RunListener::~RunListener() {
  for (lcm_subscription_t* subscription : subscriptions_) {
    lcm_unsubscribe(network_.lcm().getUnderlyingLCM(), subscription);
  }
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
    // Without a descriptor LCM's own handle() is what connects again.
    if (ready.fd >= 0 && ::poll(&ready, 1, 0) <= 0) return;
    const bool handled = network_.lcm().handle() == 0;
    if (std::exchange(out_of_memory_, false)) throw std::bad_alloc();
    if (!handled) return;
  }
}

}  // namespace abs_hil::telemetry

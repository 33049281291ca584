#pragma once

#include <lcm/lcm.h>
#include <poll.h>

#include <cstdint>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "telemetry/lcm_outlet.hpp"
#include "telemetry/outlet.hpp"

namespace abs_hil::telemetry::test {

using Bytes = std::vector<std::uint8_t>;

template <class Message>
Message decoded(const Bytes& bytes) {
  Message message{};
  if (message.decode(bytes.data(), 0, static_cast<int>(bytes.size())) != static_cast<int>(bytes.size())) {
    throw std::runtime_error("cannot decode");
  }
  return message;
}

/// Keeps what it is sent, by channel.
class CapturingOutlet : public Outlet {
 public:
  void send(const std::string& channel, std::span<const std::uint8_t> message, double /*time_s*/) noexcept override {
    messages[channel].emplace_back(message.begin(), message.end());
  }
  [[nodiscard]] std::uint64_t failures() const noexcept override { return 0; }

  template <class Message>
  [[nodiscard]] std::vector<Message> all(const std::string& channel) const {
    std::vector<Message> result;
    if (const auto found = messages.find(channel); found != messages.end()) {
      for (const Bytes& bytes : found->second) result.push_back(decoded<Message>(bytes));
    }
    return result;
  }

  std::map<std::string, std::vector<Bytes>> messages;
};

/// Receives on the LCM object of an outlet, as memq:// delivers within one object only.
class LcmCapture {
 public:
  LcmCapture(LcmOutlet& outlet, const char* channels) : lcm_(outlet.lcm().getUnderlyingLCM()) {
    subscription_ = lcm_subscribe(lcm_, channels, &on_message, this);
    lcm_subscription_set_queue_capacity(subscription_, 0);
  }
  LcmCapture(const LcmCapture&) = delete;
  LcmCapture& operator=(const LcmCapture&) = delete;
  ~LcmCapture() { lcm_unsubscribe(lcm_, subscription_); }

  /// Takes everything that is there, without waiting.
  void drain() {
    pollfd ready{lcm_get_fileno(lcm_), POLLIN, 0};
    while (::poll(&ready, 1, 0) > 0 && lcm_handle(lcm_) == 0) {
    }
  }

  CapturingOutlet captured;

 private:
  static void on_message(const lcm_recv_buf_t* received, const char* channel, void* self) {
    static_cast<LcmCapture*>(self)->captured.send(
        channel, {static_cast<const std::uint8_t*>(received->data), received->data_size}, 0.0);
  }
  lcm_t* lcm_;
  lcm_subscription_t* subscription_;
};

}  // namespace abs_hil::telemetry::test

#pragma once

#include <lcm/lcm.h>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::telemetry {

/// Receives the messages of a run. Each has been checked before decoding.
class RunObserver {
 public:
  RunObserver() = default;
  RunObserver(const RunObserver&) = delete;
  RunObserver& operator=(const RunObserver&) = delete;
  virtual ~RunObserver() = default;

  virtual void take(const telemetry_t& message) = 0;
  virtual void take(const status_t& message) = 0;
  virtual void take(const event_t& message) = 0;
  virtual void take(const experiment_t& message) = 0;
  /// Receives a message that does not have the type of its channel.
  virtual void take_malformed() = 0;
};

/// Receives the messages that another program's run publishes. Publishers may start, stop and restart.
class RunListener {
 public:
  /// `url`: empty for default_lcm_url(). Throws LcmError when there is no route or LCM does not start, and
  /// std::invalid_argument for a prefix that MessageStream would refuse. `observer` must outlive the listener.
  RunListener(std::string url, const std::string& channel_prefix, RunObserver& observer);
  RunListener(const RunListener&) = delete;
  RunListener& operator=(const RunListener&) = delete;

  /// File descriptor for poll(2); negative while there is no tcpq server.
  [[nodiscard]] int file_descriptor() noexcept { return network_.lcm().getFileno(); }
  /// Passes on the received messages without waiting: at most `messages_max`, so that a flood cannot block the caller.
  void poll(int messages_max = 20'000);

  [[nodiscard]] const std::string& url() const noexcept { return network_.url(); }

 private:
  template <class Message>
  static void on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept;
  template <class Message>
  void subscribe(const std::string& channel);
  void subscribe();
  /// Connects tcpq again, at most once a second.
  void look_for_server();

  LcmOutlet network_;
  RunObserver& observer_;
  std::string prefix_;
  std::chrono::steady_clock::time_point next_look_{};
  std::vector<lcm_subscription_t*> subscriptions_;
  bool out_of_memory_{false};
};

}  // namespace abs_hil::telemetry

#pragma once

#include <lcm/lcm.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::telemetry {

/// Receives what other programs publish, undecoded. Publishers may start, stop and restart, and so may a tcpq server.
class Receiver {
 public:
  using Take = std::function<void(const std::string& channel, std::span<const std::uint8_t> packet)>;

  /// `url`: empty for default_lcm_url(). `channels`: a regular expression. Throws std::invalid_argument for a malformed
  /// URL, and LcmError when there is no route, LCM does not start, or it refuses the expression. `take` may throw
  /// std::bad_alloc only; poll() throws it again.
  Receiver(std::string url, std::string channels, Take take);
  /// The same on a network that outlives it. memq delivers within one object only.
  Receiver(LcmOutlet& network, std::string channels, Take take);
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;
  ~Receiver();

  /// File descriptor for poll(2); negative while there is no tcpq server.
  [[nodiscard]] int file_descriptor() noexcept { return network_.lcm().getFileno(); }
  /// Passes on the received packets without waiting: at most `packets_max`, so that a flood cannot block the caller.
  void poll(int packets_max = 20'000);

  [[nodiscard]] const std::string& url() const noexcept { return network_.url(); }

 private:
  static void on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept;
  void subscribe();
  /// Connects tcpq again, at most once a second.
  void look_for_server();

  std::optional<LcmOutlet> own_{};
  LcmOutlet& network_;
  std::string channels_;
  Take take_;
  std::chrono::steady_clock::time_point next_look_{};
  lcm_subscription_t* subscription_{nullptr};
  bool out_of_memory_{false};
};

}  // namespace abs_hil::telemetry

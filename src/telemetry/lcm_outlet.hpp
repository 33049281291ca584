#pragma once

#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <span>
#include <stdexcept>
#include <string>

#include "telemetry/lcm_url.hpp"
#include "telemetry/outlet.hpp"

namespace abs_hil::telemetry {

/// LCM cannot use the URL. `what()` names the URL, the reason and the fix.
class LcmError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Publishes on an LCM network. Publishing may block for milliseconds: do not call it from the real-time thread. The
/// outlet never waits for a tcpq server that accepts no data, because it or one of its subscribers has stopped. Each
/// message that it cannot send counts as a failure. While there is no server, it looks for one once a second.
class LcmOutlet : public Outlet {
 public:
  /// `url`: empty for default_lcm_url(). Throws LcmError when there is no route, LCM does not start, or a tcpq server
  /// accepts the connection but does not answer. The server may also start later.
  explicit LcmOutlet(std::string url = {});

  void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept override;
  [[nodiscard]] std::uint64_t failures() const noexcept override { return failures_; }

  [[nodiscard]] const std::string& url() const noexcept { return url_; }
  /// "udpm", "tcpq", "memq", ...
  [[nodiscard]] const std::string& provider() const noexcept { return provider_; }
  /// LCM itself, for subscriptions in the same thread.
  [[nodiscard]] lcm::LCM& lcm() noexcept { return lcm_; }

 private:
  /// True if the server can take a message without waiting.
  [[nodiscard]] bool tcpq_ready(double time_s) noexcept;

  std::string url_;
  std::string provider_;
  Endpoint server_;  ///< of tcpq
  lcm::LCM lcm_;
  std::uint64_t failures_{0};
  double next_try_s_;  ///< run time of the next attempt with tcpq
};

}  // namespace abs_hil::telemetry

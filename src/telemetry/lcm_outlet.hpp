#pragma once

#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <span>
#include <stdexcept>
#include <string>

#include "telemetry/lcm_url.hpp"
#include "telemetry/outlet.hpp"

namespace abs_hil::telemetry {

/// LCM cannot be used as asked. `what()` names the URL, the reason and the fix.
class LcmError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Publishes on an LCM network. Publishing may block for milliseconds: never from the real-time thread. A tcpq server
/// that takes nothing, as one of its subscribers reads nothing or as it stands still, is not waited for: what it would
/// have been sent is a failure; while there is none, one a second is looked for.
class LcmOutlet : public Outlet {
 public:
  /// `url`: empty for default_lcm_url(). Throws LcmError when there is no route, LCM does not start, or a tcpq server
  /// does not answer; there need not be one yet.
  explicit LcmOutlet(std::string url = {});

  void send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept override;
  [[nodiscard]] std::uint64_t failures() const noexcept override { return failures_; }

  [[nodiscard]] const std::string& url() const noexcept { return url_; }
  /// "udpm", "tcpq", "memq", ...
  [[nodiscard]] const std::string& provider() const noexcept { return provider_; }
  /// For subscriptions in the same thread.
  [[nodiscard]] lcm::LCM& lcm() noexcept { return lcm_; }

 private:
  /// Whether a message can be given to the server without waiting for it.
  [[nodiscard]] bool tcpq_ready(double time_s) noexcept;

  std::string url_;
  std::string provider_;
  Endpoint server_;  ///< of tcpq
  lcm::LCM lcm_;
  std::uint64_t failures_{0};
  double next_try_s_;  ///< run time before which tcpq is not tried again
};

}  // namespace abs_hil::telemetry

// Publishes on LCM, and never waits for a tcpq server that accepts no data.
#include "telemetry/lcm_outlet.hpp"

#include <limits>
#include <utility>

namespace abs_hil::telemetry {
namespace {

/// Seconds between two attempts. Without a server, tcpq connects, blocks and prints two lines at every publish.
constexpr double tcpq_retry_s = 1.0;
constexpr int tcpq_start_timeout_ms = 2'000;
constexpr int tcpq_retry_timeout_ms = 200;

std::string checked(std::string url) {
  if (url.empty()) url = default_lcm_url();
  const RouteProbe probe = probe_lcm_route(url);
  if (!probe.usable) throw LcmError("LCM cannot use '" + url + "': " + probe.problem + ". To fix it:\n" + probe.fix);
  const LcmUrl parts = parse_lcm_url(url);
  if (parts.provider == "tcpq" && ask_tcpq_server(endpoint_of(parts), tcpq_start_timeout_ms) == TcpqServer::silent) {
    throw LcmError("the tcpq server of '" + url + "' does not answer: restart it, or check the URL");
  }
  return url;
}

}  // namespace

LcmOutlet::LcmOutlet(std::string url)
    : url_(checked(std::move(url))),
      provider_(parse_lcm_url(url_).provider),
      server_(provider_ == "tcpq" ? endpoint_of(parse_lcm_url(url_)) : Endpoint{}),
      lcm_(url_),
      next_try_s_(-std::numeric_limits<double>::infinity()) {
  if (!lcm_.good()) {
    const std::string need = probe_lcm_route(url_).fix;
    throw LcmError("LCM does not start with '" + url_ + "'" + (need.empty() ? "" : " (" + need + ")") +
                   "; check the URL, or run without LCM");
  }
}

void LcmOutlet::send(const std::string& channel, std::span<const std::uint8_t> message, double time_s) noexcept {
  const bool tcpq = provider_ == "tcpq";
  const bool tries = time_s >= next_try_s_ && (!tcpq || tcpq_ready(time_s));
  if (tries && lcm_publish(lcm_.getUnderlyingLCM(), channel.c_str(), message.data(),
                           static_cast<unsigned int>(message.size())) == 0) {
    return;
  }
  ++failures_;
  if (tries && tcpq) next_try_s_ = time_s + tcpq_retry_s;
}

bool LcmOutlet::tcpq_ready(double time_s) noexcept {
  const int socket = lcm_get_fileno(lcm_.getUnderlyingLCM());
  if (socket >= 0) return takes_without_waiting(socket);
  if (ask_tcpq_server(server_, tcpq_retry_timeout_ms) == TcpqServer::answers) return true;
  next_try_s_ = time_s + tcpq_retry_s;
  return false;
}

}  // namespace abs_hil::telemetry

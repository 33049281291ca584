// Takes LCM's URLs apart.
#include "telemetry/lcm_url.hpp"

#include <charconv>
#include <cstdlib>
#include <stdexcept>

namespace abs_hil::telemetry {

LcmUrl parse_lcm_url(std::string_view url) {
  const std::size_t separator = url.find("://");
  if (separator == std::string_view::npos || separator == 0) {
    throw std::invalid_argument("LCM URL '" + std::string(url) +
                                "' is not valid; give one of the form udpm://239.255.76.67:7667?ttl=0");
  }
  LcmUrl parts;
  parts.provider = url.substr(0, separator);
  std::string_view rest = url.substr(separator + 3);
  const std::size_t question = rest.find('?');
  parts.network = rest.substr(0, question);
  if (question != std::string_view::npos) parts.options = rest.substr(question + 1);
  return parts;
}

Endpoint endpoint_of(const LcmUrl& url) {
  const bool tcpq = url.provider == "tcpq";
  Endpoint endpoint{tcpq ? "127.0.0.1" : "239.255.76.67", static_cast<std::uint16_t>(tcpq ? 7700 : 7667)};
  const std::string_view network = url.network;
  const std::size_t colon = network.find(':');
  if (const std::string_view address = network.substr(0, colon); !address.empty()) endpoint.address = address;
  if (colon == std::string_view::npos) return endpoint;

  const std::string_view port = network.substr(colon + 1);
  const char* end = port.data() + port.size();
  const auto [stop, error] = std::from_chars(port.data(), end, endpoint.port);
  if (error != std::errc{} || stop != end || endpoint.port == 0) {
    throw std::invalid_argument("port '" + std::string(port) +
                                "' of the LCM URL is not valid; give a number from 1 to 65535");
  }
  return endpoint;
}

std::string default_lcm_url() {
  const char* from_environment = std::getenv("LCM_DEFAULT_URL");
  if (from_environment != nullptr && *from_environment != '\0') return from_environment;
  return "udpm://239.255.76.67:7667?ttl=0";
}

}  // namespace abs_hil::telemetry

#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace abs_hil::telemetry {

/// An LCM URL in its parts: provider://network?options.
struct LcmUrl {
  std::string provider;  ///< udpm, tcpq, memq, file, ...
  std::string network;   ///< the text between "://" and "?"
  std::string options;   ///< the text after "?"
};

/// Throws std::invalid_argument, with the URL and an example, if "provider://" is missing.
[[nodiscard]] LcmUrl parse_lcm_url(std::string_view url);

/// An IPv4 address and a port.
struct Endpoint {
  std::string address;
  std::uint16_t port{0};
};

/// Address and port of a udpm:// or tcpq:// URL. Missing parts get LCM's defaults (239.255.76.67:7667,
/// 127.0.0.1:7700). Throws std::invalid_argument for an invalid port.
[[nodiscard]] Endpoint endpoint_of(const LcmUrl& url);

/// The environment's LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0, which stays within this computer.
[[nodiscard]] std::string default_lcm_url();

}  // namespace abs_hil::telemetry

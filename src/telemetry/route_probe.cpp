// Asks the kernel whether a URL's network can be reached, before LCM does.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include "telemetry/lcm_url.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr const char* route_fix =
    "sudo ip link set lo up multicast on\n"
    "sudo ip route add 224.0.0.0/4 dev lo";

/// errno of a connected UDP socket to `to`, 0 if there is a route. Sends nothing.
int connect_udp(const sockaddr_in& to) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return errno;
  const int error = ::connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 ? 0 : errno;
  ::close(socket);
  return error;
}

RouteProbe probe_udpm(const Endpoint& endpoint) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(endpoint.port);
  if (::inet_pton(AF_INET, endpoint.address.c_str(), &to.sin_addr) != 1) {
    return {false, "'" + endpoint.address + "' is not an IPv4 address", "use udpm://239.255.76.67:7667?ttl=0"};
  }
  const std::string where = endpoint.address + ":" + std::to_string(endpoint.port);
  if (!IN_MULTICAST(ntohl(to.sin_addr.s_addr))) {
    return {false, endpoint.address + " is not a multicast address",
            "use one from 224.0.0.0 to 239.255.255.255, as in udpm://239.255.76.67:7667?ttl=0"};
  }
  const int error = connect_udp(to);
  if (error == 0) return {true, {}, {}};
  if (error == ENETUNREACH || error == EHOSTUNREACH || error == ENETDOWN) {
    return {false, "no route for multicast to " + where, route_fix};
  }
  return {false, "cannot use UDP multicast to " + where + ": " + std::generic_category().message(error), route_fix};
}

RouteProbe probe_tcpq(const Endpoint& endpoint) {
  in_addr address{};
  if (::inet_pton(AF_INET, endpoint.address.c_str(), &address) != 1) {
    // LCM 1.3 ignores a failure of inet_aton and would connect to a wrong address.
    return {false, "tcpq needs a numeric IPv4 address, not '" + endpoint.address + "'", "use tcpq://127.0.0.1:7700"};
  }
  return {true, {}, "needs lcm-tcpq-server at " + endpoint.address + ":" + std::to_string(endpoint.port)};
}

}  // namespace

RouteProbe probe_lcm_route(std::string_view url) {
  try {
    const LcmUrl parts = parse_lcm_url(url);
    if (parts.provider == "udpm") return probe_udpm(endpoint_of(parts));
    if (parts.provider == "tcpq") return probe_tcpq(endpoint_of(parts));
    if (parts.provider == "memq") return {true, {}, "messages stay within this process"};
    if (parts.provider == "file") return {true, {}, "needs a path that can be written and ?mode=w"};
    return {true, {}, "provider '" + parts.provider + "' is unknown; only LCM can check it"};
  } catch (const std::invalid_argument& error) {
    return {false, error.what(), "use udpm://239.255.76.67:7667?ttl=0"};
  }
}

}  // namespace abs_hil::telemetry

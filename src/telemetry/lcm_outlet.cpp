// What an LCM URL leads to: its parts, the route to its network, a tcpq server that answers. Publishes there, and never
// waits for a tcpq server that accepts no data.
#include "telemetry/lcm_outlet.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/endian/conversion.hpp>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <utility>

#include "rig/formatted_text.hpp"

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
  endpoint.port = rig::parse_number<std::uint16_t>(port).value_or(0);
  if (endpoint.port > 0) return endpoint;
  throw std::invalid_argument("port '" + std::string(port) +
                              "' of the LCM URL is not valid; give a number from 1 to 65535");
}

std::string default_lcm_url() {
  const char* from_environment = std::getenv("LCM_DEFAULT_URL");
  if (from_environment != nullptr && *from_environment != '\0') return from_environment;
  return "udpm://239.255.76.67:7667?ttl=0";
}

std::optional<sockaddr_in> socket_address_of(const Endpoint& endpoint) noexcept {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(endpoint.port);
  if (::inet_pton(AF_INET, endpoint.address.c_str(), &address.sin_addr) != 1) return std::nullopt;
  return address;
}

namespace {

constexpr std::uint32_t server_greeting = 0x287617fa;
constexpr std::uint32_t client_greeting = 0x287617fb;
constexpr std::uint32_t protocol_version = 0x0100;
/// The kernel grants at most twice net.core.wmem_max, about 400 kB by default. It reports room while a third is free.
constexpr int send_buffer_bytes = 1 << 20;

/// What the error of a call with a limit of time says of the server.
TcpqServer failed_call() noexcept {
  const bool in_vain = errno == EINPROGRESS || errno == EAGAIN || errno == EINTR;
  return in_vain ? TcpqServer::silent : TcpqServer::absent;
}

constexpr const char* route_fix =
    "sudo ip link set lo up multicast on\n"
    "sudo ip route add 224.0.0.0/4 dev lo";

/// errno of a connected UDP socket to `to`, 0 if there is a route. Sends nothing.
int connect_udp(const sockaddr_in& to) {
  const Socket socket(SOCK_DGRAM);
  if (socket.get() < 0) return errno;
  return ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 ? 0 : errno;
}

RouteProbe probe_udpm(const Endpoint& endpoint) {
  const auto to = socket_address_of(endpoint);
  if (!to) {
    return {false, "'" + endpoint.address + "' is not an IPv4 address", "use udpm://239.255.76.67:7667?ttl=0"};
  }
  const std::string where = endpoint.address + ":" + std::to_string(endpoint.port);
  if (!IN_MULTICAST(ntohl(to->sin_addr.s_addr))) {
    return {false, endpoint.address + " is not a multicast address",
            "use one from 224.0.0.0 to 239.255.255.255, as in udpm://239.255.76.67:7667?ttl=0"};
  }
  const int error = connect_udp(*to);
  if (error == 0) return {true, {}, {}};
  if (error == ENETUNREACH || error == EHOSTUNREACH || error == ENETDOWN) {
    return {false, "no route for multicast to " + where, route_fix};
  }
  return {false, "cannot use UDP multicast to " + where, rig::refusal(error, where, rig::reaching)};
}

RouteProbe probe_tcpq(const Endpoint& endpoint) {
  if (!socket_address_of(endpoint)) {
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

TcpqServer ask_tcpq_server(const Endpoint& endpoint, int timeout_ms) noexcept {
  using namespace std::chrono;
  const auto end = steady_clock::now() + milliseconds(timeout_ms);
  const auto to = socket_address_of(endpoint);
  const Socket socket(SOCK_STREAM);
  if (socket.get() < 0 || !to) return TcpqServer::absent;
  const auto limit = [&](int calls) {
    const auto left = std::max(ceil<microseconds>(end - steady_clock::now()), microseconds(1));  // 0 would be no limit
    const timeval most{left / seconds(1), (left % seconds(1)).count()};
    static_cast<void>(::setsockopt(socket.get(), SOL_SOCKET, calls, &most, sizeof most));
  };
  limit(SO_SNDTIMEO);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&*to), sizeof *to) != 0) return failed_call();
  const std::array<std::uint32_t, 2> greeting{htonl(client_greeting), htonl(protocol_version)};
  if (::send(socket.get(), greeting.data(), sizeof greeting, MSG_NOSIGNAL) != sizeof greeting) {
    return TcpqServer::absent;
  }
  constexpr std::size_t answer_bytes = 8;
  std::array<std::uint8_t, answer_bytes> answer{};
  for (std::size_t got = 0; got < answer.size();) {
    limit(SO_RCVTIMEO);
    const ssize_t size = ::recv(socket.get(), answer.data() + got, answer.size() - got, 0);
    if (size < 0) return failed_call();
    if (size == 0) return TcpqServer::absent;
    got += static_cast<std::size_t>(size);
  }
  return boost::endian::load_big_u32(answer.data()) == server_greeting ? TcpqServer::answers : TcpqServer::silent;
}

bool takes_without_waiting(int socket) noexcept {
  // Set at every call, because LCM may have connected again.
  static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &send_buffer_bytes, sizeof send_buffer_bytes));
  pollfd ready{socket, POLLOUT, 0};
  return ::poll(&ready, 1, 0) > 0;
}

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

#pragma once

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "telemetry/outlet.hpp"

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

/// The same for the system; nothing if the address is no IPv4 address in numbers.
[[nodiscard]] std::optional<sockaddr_in> socket_address_of(const Endpoint& endpoint) noexcept;

/// A socket of IPv4 that closes itself; its descriptor is < 0 if the system has none.
class Socket {
 public:
  explicit Socket(int type) : descriptor_(::socket(AF_INET, type | SOCK_CLOEXEC, 0)) {}
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  [[nodiscard]] int get() const noexcept { return descriptor_; }

 private:
  int descriptor_;
};

/// The environment's LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0, which stays within this computer.
[[nodiscard]] std::string default_lcm_url();

/// Result of a check whether LCM can use a URL on this computer. It runs before LCM, whose own error text misleads.
struct RouteProbe {
  bool usable{false};
  std::string problem;  ///< one line; empty if usable
  std::string fix;      ///< commands or advice, lines without a final line end; empty if nothing needs a fix
};

/// For udpm, asks the kernel for a route by a UDP connect(), which sends nothing. Other providers count as usable,
/// because a check would have side effects; `fix` names what they need. Throws only std::bad_alloc.
[[nodiscard]] RouteProbe probe_lcm_route(std::string_view url);

// liblcm's tcpq waits without limit for a server that has stopped, both when it connects and when it publishes. These
// functions check the server first.

/// Answer of a tcpq server to a connection.
enum class TcpqServer : std::uint8_t {
  answers,
  absent,  ///< refused at once: there is no server or no route
  silent,  ///< no answer in time: it has stopped, its computer is off, or it is not a tcpq server
};

/// Connects, exchanges greetings as LCM does, and hangs up. Takes `timeout_ms` at most. Not from the real-time thread.
[[nodiscard]] TcpqServer ask_tcpq_server(const Endpoint& endpoint, int timeout_ms) noexcept;

/// True if a message of up to 100 kB can be written to a connection now without waiting for the server. Also true for a
/// broken connection: the write then fails.
[[nodiscard]] bool takes_without_waiting(int socket) noexcept;

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

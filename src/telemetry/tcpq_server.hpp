#pragma once

#include <cstddef>
#include <cstdint>

#include "telemetry/lcm_url.hpp"

namespace abs_hil::telemetry {

// liblcm's tcpq waits without end for a server that stands still: when it connects, and when it publishes. Asked first.

/// What a tcpq server does when somebody connects.
enum class TcpqServer : std::uint8_t {
  answers,
  absent,  ///< refused at once: none there, or no route
  silent,  ///< no answer in time: it stands still, its computer is off, or it is no tcpq server
};

/// Connects, exchanges greetings as LCM does, and hangs up. Takes `timeout_ms` at most. Not from the real-time thread.
[[nodiscard]] TcpqServer ask_tcpq_server(const Endpoint& endpoint, int timeout_ms) noexcept;

/// Whether a message of up to 100 kB can be written to a connection now without waiting for the server. True for a
/// broken connection, too: writing tells then.
[[nodiscard]] bool takes_without_waiting(int socket) noexcept;

}  // namespace abs_hil::telemetry

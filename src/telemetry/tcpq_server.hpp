#pragma once

#include <cstddef>
#include <cstdint>

#include "telemetry/lcm_url.hpp"

namespace abs_hil::telemetry {

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

}  // namespace abs_hil::telemetry

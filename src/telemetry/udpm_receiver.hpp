#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "telemetry/lcm_packet.hpp"

namespace abs_hil::telemetry {

/// Takes the messages of one channel from LCM's UDP multicast, those that fit one datagram and `payload_max`, without
/// liblcm. A program that moves a machine must not be ended by who sends it packets: liblcm 1.3.1 believes fragments
/// about the size of their message, which it allocates, up to 256 MB, and about where they belong in it, and writes
/// there. Here nothing is put together, so that there is nothing to believe, and nothing is allocated after the
/// construction. Used from one thread.
class UdpmReceiver {
 public:
  static constexpr std::size_t payload_max = 2048;  ///< bytes

  /// `url`: udpm://…; its recv_buf_size is asked for. Throws LcmError, naming the address, where the group cannot be
  /// joined.
  UdpmReceiver(const std::string& url, std::string channel);
  UdpmReceiver(const UdpmReceiver&) = delete;
  UdpmReceiver& operator=(const UdpmReceiver&) = delete;
  ~UdpmReceiver();

  /// For poll(2).
  [[nodiscard]] int file_descriptor() const noexcept { return socket_; }

  struct Arrival {
    bool any{false};                          ///< false: nothing of the channel is there now
    bool too_long{false};                     ///< there was a message, of more than one datagram or `payload_max`
    std::span<const std::uint8_t> payload{};  ///< valid until the next call
  };
  /// The next message of the channel, without waiting; looks at 256 datagrams at most.
  Arrival next() noexcept;

  /// Datagrams of any channel that the kernel dropped, as they came faster than they were taken.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  int socket_{-1};
  std::string channel_;
  std::array<std::uint8_t, lcm_packet_overhead_max + payload_max> datagram_{};
  std::uint64_t dropped_{0};
  std::uint32_t dropped_seen_{0};  ///< the kernel's own counter, which wraps
};

}  // namespace abs_hil::telemetry

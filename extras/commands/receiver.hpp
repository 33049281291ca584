#pragma once

#include <lcm/lcm.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::commands {

/// Receives what other programs publish, undecoded. Publishers may start, stop and restart, and so may a tcpq server.
class Receiver {
 public:
  using Take = std::function<void(const std::string& channel, std::span<const std::uint8_t> packet)>;

  /// `url`: empty for default_lcm_url(). `channels`: a regular expression. Throws std::invalid_argument for a malformed
  /// URL, and LcmError when there is no route, LCM does not start, or it refuses the expression. `take` may throw
  /// std::bad_alloc only; poll() throws it again.
  Receiver(std::string url, std::string channels, Take take);
  /// The same on a network that outlives it. memq delivers within one object only.
  Receiver(telemetry::LcmOutlet& network, std::string channels, Take take);
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;
  ~Receiver();

  /// File descriptor for poll(2); negative while there is no tcpq server.
  [[nodiscard]] int file_descriptor() noexcept { return network_.lcm().getFileno(); }
  /// Passes on the received packets without waiting: at most `packets_max`, so that a flood cannot block the caller.
  void poll(int packets_max = 20'000);

  [[nodiscard]] const std::string& url() const noexcept { return network_.url(); }

 private:
  static void on_packet(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept;
  void subscribe();
  /// Connects tcpq again, at most once a second.
  void look_for_server();

  std::optional<telemetry::LcmOutlet> own_{};
  telemetry::LcmOutlet& network_;
  std::string channels_;
  Take take_;
  std::chrono::steady_clock::time_point next_look_{};
  lcm_subscription_t* subscription_{nullptr};
  bool out_of_memory_{false};
};

/// The kind of a datagram of LCM's UDP multicast, for a reader of one channel that takes whole messages only.
struct LcmPacket {
  enum class Kind : std::uint8_t {
    other,       ///< of another channel, the rest of a fragmented message, or not LCM
    message,     ///< a whole message of the channel
    fragmented,  ///< the beginning of a message of the channel that did not fit one datagram
  };
  Kind kind{Kind::other};
  std::span<const std::uint8_t> payload{};  ///< of a message: the encoded type, within the datagram
};

/// Largest size before the payload, bytes: header, longest channel name and its NUL.
inline constexpr std::size_t lcm_packet_overhead_max = 20 + 63 + 1;

/// Reads LCM's own framing, big-endian: 'LC02', message number, channel, NUL, payload; a message of several datagrams
/// has 'LC03' instead, and its first datagram has size, offset and count before the channel. Any bytes are allowed.
[[nodiscard]] LcmPacket look_at(std::span<const std::uint8_t> datagram, std::string_view channel) noexcept;

/// Receives the messages of one channel from LCM's UDP multicast without liblcm. A message must fit one datagram and
/// `payload_max`. No packet may end a program that moves a machine, but liblcm 1.3.1 trusts fragments: it allocates the
/// size that they claim, up to 256 MB, and writes at the offset that they claim. This class assembles no fragments, and
/// it allocates nothing after construction. Used from one thread.
///
/// ttl=0 (LCM's default) means that messages stay within this computer. This holds for what this program sends; the
/// group reaches it from the whole network. So with ttl=0 it takes only messages whose sender has an address of this
/// computer. (The kernel drops packets from outside that claim such an address.)
class UdpmReceiver {
 public:
  static constexpr std::size_t payload_max = 2048;  ///< bytes

  /// `url`: udpm://…; its recv_buf_size is requested from the kernel. Throws LcmError, naming the address, if it
  /// cannot join the group.
  UdpmReceiver(const std::string& url, std::string channel);

  /// For poll(2).
  [[nodiscard]] int file_descriptor() const noexcept { return socket_.get(); }

  struct Arrival {
    bool any{false};                          ///< false: there is no message of the channel now
    bool too_long{false};                     ///< true: the message is larger than one datagram or `payload_max`
    std::span<const std::uint8_t> payload{};  ///< valid until the next call
  };
  /// Returns the next message of the channel without waiting. It reads at most 256 datagrams.
  Arrival next() noexcept;

  /// Datagrams of any channel that the kernel dropped, because they came faster than they were read.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  [[nodiscard]] bool is_from_here(const in_addr& sender) noexcept;

  telemetry::Socket socket_{SOCK_DGRAM | SOCK_NONBLOCK};
  bool own_computer_only_{true};
  in_addr_t known_own_address_{0};  ///< of the last sender on this computer; 0: none yet
  std::string channel_;
  std::array<std::uint8_t, lcm_packet_overhead_max + payload_max> datagram_{};
  std::uint64_t dropped_{0};
  std::uint32_t dropped_seen_{0};  ///< the kernel's own counter, which wraps
};

}  // namespace abs_hil::commands

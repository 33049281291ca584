#pragma once

#include <net/if.h>

#include <cstdint>

#include "driver/can/frame.hpp"

namespace abs_hil::driver::can {

enum class SendOutcome : std::uint8_t {
  sent,  ///< the kernel has it; only the node's answer shows whether it reached the bus
  full,  ///< not sent: the queue is full (EAGAIN, ENOBUFS)
  down,  ///< the interface is down or gone, or the peer of a socket pair is
  failed,
};
struct [[nodiscard]] SendResult {
  SendOutcome outcome{SendOutcome::sent};
  int errno_value{0};
};

enum class ReceiveOutcome : std::uint8_t {
  frame,
  nothing,    ///< no frame until the deadline
  malformed,  ///< data with the wrong size for a frame; only a socket other than CAN can deliver it
  down,       ///< as SendOutcome::down
  failed,
};
struct [[nodiscard]] ReceiveResult {
  ReceiveOutcome outcome{ReceiveOutcome::nothing};
  int errno_value{0};
};

/// Sends and receives frames (`struct can_frame` or `struct canfd_frame`) on a socket that keeps message boundaries: a
/// raw CAN socket, or for emulators and tests an AF_UNIX socket of type SOCK_SEQPACKET or SOCK_DGRAM. Only `receive`
/// blocks, up to its deadline. `send` and `receive` are real-time safe apart from their system calls.
class FrameSocket {
 public:
  /// Takes ownership of an open socket. Makes it non-blocking and enables receive time stamps and the drop count.
  explicit FrameSocket(int descriptor) noexcept;
  FrameSocket(const FrameSocket&) = delete;
  FrameSocket& operator=(const FrameSocket&) = delete;
  virtual ~FrameSocket();

  SendResult send(const Frame& frame) noexcept;
  /// @param deadline_ns monotonic clock; if it is in the past the call does not wait
  virtual ReceiveResult receive(Frame& frame, std::int64_t deadline_ns) noexcept;
  /// Number of frames that the kernel has dropped because this socket's queue was full.
  [[nodiscard]] std::uint32_t dropped() const noexcept { return dropped_; }
  /// Discards the frames received so far, up to a fixed number.
  void drain() noexcept;
  /// Gets the flags of the interface that `request` names (SIOCGIFFLAGS); false if it does not exist.
  [[nodiscard]] bool ask_interface(ifreq& request) const noexcept;

 private:
  ReceiveResult take(Frame& frame) noexcept;

  int descriptor_;
  std::uint32_t dropped_{0};
};

}  // namespace abs_hil::driver::can

#pragma once

#include <net/if.h>

#include <cstdint>

#include "driver/can/frame.hpp"

namespace abs_hil::driver::can {

enum class SendOutcome : std::uint8_t {
  sent,  ///< handed to the kernel: whether it reaches the bus the node's answer tells
  full,  ///< no room in the queue now (EAGAIN, ENOBUFS): not sent
  down,  ///< the interface is down or gone, or the other end of a socket pair
  failed,
};
struct [[nodiscard]] SendResult {
  SendOutcome outcome{SendOutcome::sent};
  int errno_value{0};
};

enum class ReceiveOutcome : std::uint8_t {
  frame,
  nothing,    ///< none until the deadline
  malformed,  ///< something that is no frame at all (its size); another socket than CAN alone can bring it
  down,       ///< as SendOutcome::down
  failed,
};
struct [[nodiscard]] ReceiveResult {
  ReceiveOutcome outcome{ReceiveOutcome::nothing};
  int errno_value{0};
};

/// Sends and receives frames, as `struct can_frame` or `struct canfd_frame`, on any socket that keeps datagrams apart:
/// a raw CAN socket, or an AF_UNIX one of type SOCK_SEQPACKET or SOCK_DGRAM in its place, which emulators and tests
/// use. Never blocks but for `receive` up to its deadline. `send` and `receive` are real-time safe save their system
/// calls.
class FrameSocket {
 public:
  /// Takes over an open socket; sets it non-blocking and asks for receive time stamps and for the count of drops.
  explicit FrameSocket(int descriptor) noexcept;
  FrameSocket(const FrameSocket&) = delete;
  FrameSocket& operator=(const FrameSocket&) = delete;
  virtual ~FrameSocket();

  SendResult send(const Frame& frame) noexcept;
  /// @param deadline_ns monotonic clock; in the past: takes what is there and never waits
  virtual ReceiveResult receive(Frame& frame, std::int64_t deadline_ns) noexcept;
  /// Frames that the kernel dropped because this socket's queue was full, since it was opened.
  [[nodiscard]] std::uint32_t dropped() const noexcept { return dropped_; }
  /// Throws away what has been received so far; bounded.
  void drain() noexcept;
  /// Asks for the flags of the interface that `request` names (SIOCGIFFLAGS); false if there is none.
  [[nodiscard]] bool ask_interface(ifreq& request) const noexcept;

 private:
  ReceiveResult take(Frame& frame) noexcept;

  int descriptor_;
  std::uint32_t dropped_{0};
};

}  // namespace abs_hil::driver::can

// The wire of a CAN node: frames on a raw socket, what the kernel knows of the interfaces (rtnetlink), what the
// controller reports, how the interface is opened.

#pragma once

#include <net/if.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "driver/board_options.hpp"
#include "driver/can/protocol.hpp"
#include "driver/file_descriptor.hpp"

namespace abs_hil::driver::can {

/// Properties of one CAN interface, from the kernel (rtnetlink).
struct InterfaceFacts {
  std::string name{};
  std::string kind{};  ///< "can", "vcan", ...; empty: not known
  bool up{false};
  bool running{false};        ///< it has a carrier: it is neither bus-off nor stopped
  bool can_fd{false};         ///< it currently takes CAN FD frames
  std::string state{};        ///< controller state: "error-active", "error-passive", "bus-off", ...; empty: none
  std::uint32_t bit_rate{0};  ///< bit/s; 0: none (vcan) or not set
  std::uint32_t data_bit_rate{0};
  std::uint32_t transmit_errors{0};
  std::uint32_t receive_errors{0};
};

/// All interfaces of type CAN, sorted by name; empty if there is none. Throws Unavailable if rtnetlink fails.
[[nodiscard]] std::vector<InterfaceFacts> can_interfaces();
/// Parses one answer of the kernel (rtnetlink messages such as RTM_NEWLINK) and adds its interfaces of type CAN.
/// Returns true after the last answer, and on an error or an invalid message.
[[nodiscard]] bool take_links(std::span<const unsigned char> answer, std::vector<InterfaceFacts>& found);
/// The interface with this name, if any.
[[nodiscard]] std::optional<InterfaceFacts> find_interface(const std::string& name);

/// What prevents the use of an interface, and the command that mends it.
[[nodiscard]] std::optional<FoundBoard::Obstacle> problem_of(const InterfaceFacts& facts);

/// What `abs_hil doctor` says: each interface with its state, its bit rate and the load of a run at `rate_Hz`, then the
/// load on a bus of 1 Mbit/s. A missing interface, or missing kernel support, is a note. The load of a vcan interface
/// is meaningless. @param can_sockets  whether this kernel has them
[[nodiscard]] std::vector<Finding> judge(const std::vector<InterfaceFacts>& interfaces, bool can_sockets,
                                         double rate_Hz);
[[nodiscard]] std::vector<Finding> inspect(const CanOptions& options, double rate_Hz, bool chosen);

/// Sends and receives frames (`struct can_frame` or `struct canfd_frame`) on a socket that keeps message boundaries: a
/// raw CAN socket, or for emulators and tests an AF_UNIX socket of type SOCK_SEQPACKET or SOCK_DGRAM. Only `receive`
/// blocks, up to its deadline. `send` and `receive` are real-time safe apart from their system calls. Both fail with
/// `disconnected`; its reason is `can_interface_down` if the interface, or the peer of a socket pair, is down or gone.
class FrameSocket {
 public:
  /// Takes ownership of an open socket. Makes it non-blocking and enables receive time stamps and the drop count.
  explicit FrameSocket(FileDescriptor descriptor) noexcept;
  explicit FrameSocket(int descriptor) noexcept : FrameSocket(FileDescriptor(descriptor)) {}
  virtual ~FrameSocket() = default;

  /// `ok`: the kernel has it; only the node's answer shows whether it reached the bus. `no_answer`: not sent, because
  /// the queue is full (EAGAIN, ENOBUFS).
  IoResult send(const Frame& frame) noexcept;
  /// `no_answer`: no frame until the deadline. `incomplete_answer`: data with the wrong size for a frame; only a socket
  /// other than CAN can deliver it.
  /// @param deadline_ns monotonic clock; if it is in the past the call does not wait
  virtual IoResult receive(Frame& frame, std::int64_t deadline_ns) noexcept;
  /// Hands each frame that comes to `heard` until that returns true: then true. False at the deadline, when the bus is
  /// down, and after 1000 frames, so that a flooded bus holds nobody for ever.
  template <class Heard>
  bool listen(std::int64_t deadline_ns, Heard heard) noexcept {
    constexpr int most_frames = 1000;
    Frame frame;
    for (int i = 0; i < most_frames; ++i) {
      const IoError error = receive(frame, deadline_ns).error;
      if (error == IoError::incomplete_answer) continue;
      if (error != IoError::none) return false;
      if (heard(frame)) return true;
    }
    return false;
  }
  /// Number of frames that the kernel has dropped because this socket's queue was full.
  [[nodiscard]] std::uint32_t dropped() const noexcept { return dropped_; }
  /// Discards the frames received so far, up to a fixed number.
  void drain() noexcept;
  /// Gets the flags of the interface that `request` names (SIOCGIFFLAGS); false if it does not exist.
  [[nodiscard]] bool ask_interface(ifreq& request) const noexcept;

 private:
  IoResult take(Frame& frame) noexcept;

  FileDescriptor descriptor_;
  std::uint32_t dropped_{0};
};

/// State of the CAN controller, from an error frame of the kernel. Several members may be true at once. Bus errors,
/// arbitration and missing acknowledgements are not told: lasting ones show as losses.
struct BusReport {
  bool bus_off{false};
  bool error_passive{false};
  bool error_warning{false};
  bool receive_overflow{false};  ///< the controller's own queue
};
[[nodiscard]] BusReport bus_report(const Frame& error_frame) noexcept;

/// A bus ready for use.
struct Link {
  std::unique_ptr<FrameSocket> socket{};
  std::string place{};                    ///< name for messages
  bool can_fd{false};                     ///< it carries CAN FD frames
  std::optional<InterfaceFacts> facts{};  ///< only for a real interface

  explicit operator bool() const noexcept { return socket != nullptr; }
  /// True if the interface is up and has a carrier. Makes a system call; the driver calls it when answers are missing.
  [[nodiscard]] bool running() const noexcept;
};

/// Opens the interface that the options name: a raw CAN socket with error frames and kernel filters for the node's
/// identifiers, or for "unix:PATH" the socket of an emulator. Throws Unavailable with cause and fix.
/// @param wait  for up to 2 s: for the carrier of an interface that was just set up, or for a busy socket
[[nodiscard]] Link open_link(const CanOptions& options, bool wait = true);

/// Prefix of `driver.can.interface` for a socket in place of a bus.
inline constexpr const char* unix_prefix = "unix:";

}  // namespace abs_hil::driver::can

#pragma once

#include <memory>
#include <optional>
#include <string>

#include "driver/can/frame_socket.hpp"
#include "driver/can/interface_facts.hpp"
#include "driver/can/options.hpp"

namespace abs_hil::driver::can {

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

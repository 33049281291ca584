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
  std::string place{};                    ///< for messages
  bool can_fd{false};                     ///< carries CAN FD frames
  std::optional<InterfaceFacts> facts{};  ///< of a real interface

  /// Whether the interface is up and has its carrier, asked when answers fail to come; a system call.
  [[nodiscard]] bool running() const noexcept;
};

/// Opens the interface that the options name: raw CAN with kernel filters for the node's identifiers and with error
/// frames; or "unix:PATH", an emulator's socket. Throws Unavailable with the cause and what mends it.
[[nodiscard]] Link open_link(const CanOptions& options);

/// Prefix of `driver.can.interface` for a socket in place of a bus.
inline constexpr const char* unix_prefix = "unix:";

}  // namespace abs_hil::driver::can

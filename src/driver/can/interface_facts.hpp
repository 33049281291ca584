// What the kernel knows of the CAN interfaces (rtnetlink).

#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

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
  std::uint32_t restart_ms{0};  ///< > 0: the kernel restarts a bus-off controller by itself
  std::uint32_t queue_length{0};
};

/// All interfaces of type CAN, sorted by name; empty if there is none. Throws Unavailable if rtnetlink fails.
[[nodiscard]] std::vector<InterfaceFacts> can_interfaces();
/// Parses one answer of the kernel (rtnetlink messages such as RTM_NEWLINK) and adds its interfaces of type CAN.
/// Returns true after the last answer, and on an error or an invalid message.
[[nodiscard]] bool take_links(std::span<const unsigned char> answer, std::vector<InterfaceFacts>& found);
/// The interface with this name, if any.
[[nodiscard]] std::optional<InterfaceFacts> find_interface(const std::string& name);

/// A problem that prevents the use of an interface, and the command that fixes it.
struct InterfaceProblem {
  std::string what{};
  std::string fix{};
};
[[nodiscard]] std::optional<InterfaceProblem> problem_of(const InterfaceFacts& facts);

}  // namespace abs_hil::driver::can

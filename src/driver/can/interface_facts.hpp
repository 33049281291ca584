#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace abs_hil::driver::can {

/// What the kernel tells about one CAN interface (rtnetlink).
struct InterfaceFacts {
  std::string name{};
  std::string kind{};  ///< "can", "vcan", ...; empty: the kernel does not say
  bool up{false};
  bool running{false};        ///< has its carrier: not bus-off, not stopped
  bool can_fd{false};         ///< takes CAN FD frames now
  std::string state{};        ///< of the controller: "error-active", "error-passive", "bus-off", ...; empty: has none
  std::uint32_t bit_rate{0};  ///< bit/s; 0: has none (vcan) or it is not set
  std::uint32_t data_bit_rate{0};
  std::uint32_t transmit_errors{0};
  std::uint32_t receive_errors{0};
  std::uint32_t restart_ms{0};  ///< > 0: the kernel restarts a bus-off controller by itself
  std::uint32_t queue_length{0};
};

/// All interfaces of type CAN, by name. Empty where there is none. Throws Unavailable if the kernel cannot be asked.
[[nodiscard]] std::vector<InterfaceFacts> can_interfaces();
/// Takes one answer of the kernel apart (messages of rtnetlink, RTM_NEWLINK among them) and adds its interfaces of type
/// CAN. True at the end of all answers, which is also where an error or a message that cannot be true stands.
[[nodiscard]] bool take_links(std::span<const unsigned char> answer, std::vector<InterfaceFacts>& found);
/// One of them; nothing if there is none of this name.
[[nodiscard]] std::optional<InterfaceFacts> find_interface(const std::string& name);

/// What hinders its use, with the command that mends it.
struct InterfaceProblem {
  std::string what{};
  std::string fix{};
};
[[nodiscard]] std::optional<InterfaceProblem> problem_of(const InterfaceFacts& facts);

}  // namespace abs_hil::driver::can

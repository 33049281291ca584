#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "abs_hil/rig/reason.hpp"

namespace abs_hil::driver {

/// Errors of the board, as numbers that the real-time thread can pass on.
enum class IoError : std::uint8_t {
  none = 0,
  not_active,            ///< read or write while the driver is not active: nothing was sent
  no_answer,             ///< the board did not answer in time
  disconnected,          ///< the board is gone (unplugged, interface down, all-ones)
  read_back_mismatch,    ///< a register does not hold what was written
  implausible_answer,    ///< an answer outside the range of possible values
  command_out_of_range,  ///< a command with a duty not in [0, 1], a torque < 0 or a value that is not finite
  stalled,               ///< the board refuses the transfer (USB STALL)
  incomplete_answer,     ///< an answer of the wrong length
  transfer_failed,       ///< a transfer failed on the bus
  access_refused,        ///< the system does not allow the access (kernel lockdown, permissions)
  foreign_writer,        ///< an output has a value that this program did not send: something else writes to the board
};

[[nodiscard]] constexpr std::string_view description(IoError error) noexcept {
  switch (error) {
    case IoError::none: return "none";
    case IoError::not_active: return "driver is not active";
    case IoError::no_answer: return "board did not answer in time";
    case IoError::disconnected: return "board is gone";
    case IoError::read_back_mismatch: return "register does not read back what was written";
    case IoError::implausible_answer: return "answer outside what the board can say";
    case IoError::command_out_of_range: return "command is not finite or outside its range";
    case IoError::stalled: return "board refuses the transfer (STALL)";
    case IoError::incomplete_answer: return "answer of the wrong length";
    case IoError::transfer_failed: return "transfer failed on the bus";
    case IoError::access_refused: return "the system refuses the access";
    case IoError::foreign_writer: return "something else writes to the board";
  }
  return "unknown error";
}

/// Result of one read or write. `where` is the register offset, CAN id or endpoint concerned. `errno_value` is the
/// system's error, 0 if there is none. `reason` is the backend's own reason for logs; if it is `none` the executive
/// uses `driver_read_failed` or `driver_write_failed`.
struct [[nodiscard]] IoResult {
  IoError error{IoError::none};
  std::uint32_t where{0};
  int errno_value{0};
  rig::Reason reason{rig::Reason::none};
  [[nodiscard]] constexpr bool ok() const noexcept { return error == IoError::none; }
};

/// The backend's own reason, or `otherwise` if it gives none.
[[nodiscard]] constexpr rig::Reason reason_of(const IoResult& result, rig::Reason otherwise) noexcept {
  return result.reason == rig::Reason::none ? otherwise : result.reason;
}

/// Text for messages: error, place and the system's error text, if any. Not real-time safe.
[[nodiscard]] std::string error_text(const IoResult& result);

/// The backend, or something that it needs, is missing, cannot be opened or is not the expected one. The message names
/// the thing and the fix; the program ends with status 3.
class Unavailable : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace abs_hil::driver

#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/reason.hpp"

namespace abs_hil::guardian {

/// What a guard did for one run. A plain value: it travels between processes.
struct GuardianReport {
  rig::Reason reason{rig::Reason::none};  ///< `none`: the run ended in order and the guard was dismissed
  bool acted{false};                      ///< the guard wrote the safe state
  bool verified{false};                   ///< it read the safe state back
  bool controller_lives{false};           ///< the controller was left alive: it drives nothing any more
  bool ended_controller{false};           ///< the guard ended the controller
  bool released{false};                   ///< a person ended the guard's tries
  driver::IoResult last_error{};          ///< error of the last failed try
  int tries{0};                           ///< number of attempts to write the safe state
  std::int64_t silence_ns{0};             ///< time without a heartbeat when the guard decided to act
  std::int64_t noticed_ns{0};             ///< when the guard decided to act, monotonic clock
  std::int64_t controller_gone_ns{0};     ///< when the controller was seen to have ended; 0: never
  std::int64_t first_written_ns{0};       ///< when the first try was over
  std::int64_t verified_ns{0};            ///< when the safe state had been read back
};

/// The report as several lines of text, for log and file. `controller` is the process id of the controller.
[[nodiscard]] std::string to_text(const GuardianReport& report, int controller);

}  // namespace abs_hil::guardian

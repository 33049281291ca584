#pragma once

namespace abs_hil::program {

/// Exit statuses of the program (docs/experiments.md).
enum ExitStatus : int {
  exit_completed = 0,
  exit_ended_early = 1,    ///< a fault, a limit, a stop command, or recorded data lost
  exit_usage = 2,          ///< usage or configuration; nothing has moved
  exit_unavailable = 3,    ///< the backend or a required resource is unavailable
  exit_hung_up = 129,      ///< SIGHUP, after the safe stop
  exit_interrupted = 130,  ///< SIGINT, after the safe stop
  exit_terminated = 143,   ///< SIGTERM, after the safe stop
};

}  // namespace abs_hil::program

#pragma once

#include "abs_hil/rig/option.hpp"

namespace abs_hil::guardian {

/// Everything below `guardian.` in the configuration.
struct GuardianOptions {
  ABS_HIL_OPTIONS(GuardianOptions);
  ABS_HIL_OPTION(bool, enabled, true,
                 .meaning = "guardian: watchdog process beside a run on a board; off only with driver.emulated");
  ABS_HIL_OPTION(double, timeout_ms, 20.0, .unit = "ms",
                 .meaning = "time without a sign of life of the cycle after which the guardian acts",
                 .range = rig::between(2, 1000));
  /// Without end on hardware. An emulator that is gone does not come back.
  ABS_HIL_OPTION(double, insist_s, 0.0, .unit = "s",
                 .meaning =
                     "how long the guardian tries to verify the safe state; 0: until it is, or a person releases "
                     "it; 10 s on an emulator",
                 .range = rig::from_zero(1e6));
  ABS_HIL_OPTION(std::string, resident, "auto",
                 .meaning =
                     "who guards a run on a board. auto: the resident service on a real board if there is one, "
                     "else a guardian of the run's own; require: the service; off: a guardian of the run's own",
                 .allowed = {"auto", "require", "off"});
  ABS_HIL_OPTION(std::string, socket, "/run/abs_hil/guardian.sock",
                 .meaning = "socket at which the resident service grants leases");
  ABS_HIL_OPTION(double, keep_ms, 250.0, .unit = "ms",
                 .meaning = "resident service without a lease: time from one verified safe state to the next",
                 .range = rig::between(10, 10'000));
};

}  // namespace abs_hil::guardian

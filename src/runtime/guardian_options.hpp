#pragma once

#include "abs_hil/rig/option.hpp"

namespace abs_hil::runtime {

/// Everything below `guardian.` in the configuration.
struct GuardianOptions {
  ABS_HIL_OPTIONS(GuardianOptions);
  ABS_HIL_OPTION(bool, enabled, true,
                 .meaning = "guardian: watchdog process beside a run on a board; off only with driver.emulated",
                 .safety = rig::judged_elsewhere);
  ABS_HIL_OPTION(double, timeout_ms, 20.0, .unit = "ms",
                 .meaning = "time without a sign of life of the cycle after which the guardian acts",
                 .range = rig::between(2, 1000), .safety = rig::weaker_above(40, "outputs_on_after_death"));
  /// Without end on hardware. An emulator that is gone does not come back.
  ABS_HIL_OPTION(double, insist_s, 0.0, .unit = "s",
                 .meaning =
                     "how long the guardian tries to verify the safe state; 0: until it is, or a person releases "
                     "it; 10 s on an emulator",
                 .range = rig::from_zero(1e6), .safety = rig::weaker_unless(0));
  ABS_HIL_OPTION(std::string, resident, "auto",
                 .meaning =
                     "who guards a run on a board. auto: the resident service on a real board if there is one, "
                     "else a guardian of the run's own; require: the service; off: a guardian of the run's own",
                 .allowed = {"auto", "require", "off"}, .safety = rig::weaker_if("off"));
  ABS_HIL_OPTION(std::string, socket, "/run/abs_hil/guardian.sock",
                 .meaning = "socket at which the resident service grants leases",
                 .safety = rig::weaker_unless("/run/abs_hil/guardian.sock"));
  ABS_HIL_OPTION(double, keep_ms, 5.0, .unit = "ms",
                 .meaning = "while no run is covered: time from one look at the outputs to the next",
                 .range = rig::between(1, 20), .safety = rig::weaker_above(10));
  /// The guard looks every 5 ms at most. A computer without real-time scheduling needs more.
  ABS_HIL_OPTION(double, standby_ms, 50.0, .unit = "ms",
                 .meaning = "resident service: time without a sign of life of the guard after which its standby acts",
                 .range = rig::between(20, 1000), .safety = rig::weaker_above(100));
};

}  // namespace abs_hil::runtime

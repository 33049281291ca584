#pragma once

#include "abs_hil/rig/reason.hpp"
#include "experiment/run_session.hpp"

namespace abs_hil::program {

/// Descriptors 0, 1 and 2 that were closed before the program started lead to /dev/null from now on, so that no file
/// of a run takes their place and gets words meant for people; SIGPIPE is ignored.
void survive_closed_terminals();

/// From now on SIGINT, SIGTERM and SIGHUP are noted instead of ending the program; SIGHUP stays ignored under nohup.
void note_signals();
/// The stop that a signal has asked for; `none` if there was none.
[[nodiscard]] rig::Reason signalled() noexcept;

/// As long as it lives, a signal ends the session's run at its next cycle, straight from the handler: a slow side that
/// hangs at a disk or network holds nothing up. A second signal ends the program at once, if that is safe.
class SignalsStop {
 public:
  /// @param may_leave  outputs are looked after by a guardian, or there are none
  SignalsStop(experiment::RunSession& session, bool may_leave) noexcept;
  SignalsStop(const SignalsStop&) = delete;
  SignalsStop& operator=(const SignalsStop&) = delete;
  ~SignalsStop();
  /// The outputs are safe: a second signal may end the program from now on.
  void allow_leaving() noexcept;
};

}  // namespace abs_hil::program

#pragma once

#include "abs_hil/rig/reason.hpp"
#include "run/run.hpp"

namespace abs_hil::program {

/// Opens /dev/null on each of the descriptors 0, 1 and 2 that was closed at program start, so that no file of the run
/// gets that number and receives messages for people. Also ignores SIGPIPE.
void survive_closed_terminals();

/// From now on SIGINT, SIGTERM and SIGHUP are noted and do not end the program. Under nohup SIGHUP stays ignored.
/// @param may_leave  a second signal ends the program at once: there are no outputs
void note_signals(bool may_leave = false);
[[nodiscard]] constexpr bool is_signal(rig::Reason reason) noexcept {
  return reason == rig::Reason::interrupt_signal || reason == rig::Reason::terminate_signal ||
         reason == rig::Reason::hangup_signal;
}
/// Exit status of a program that a signal ended.
[[nodiscard]] int status_of(rig::Reason signal) noexcept;
/// The stop reason of a noted signal; `none` if there was none.
[[nodiscard]] rig::Reason signalled() noexcept;

/// While this object lives, a signal ends the run at its next cycle, directly from the handler: a slow thread
/// that hangs at a disk or network causes no delay. A second signal ends the program at once, if that is safe.
class SignalsStop {
 public:
  /// @param may_leave  true if a guardian protects the outputs, or if there are no real outputs
  SignalsStop(run::Run& run, bool may_leave) noexcept;
  SignalsStop(const SignalsStop&) = delete;
  SignalsStop& operator=(const SignalsStop&) = delete;
  ~SignalsStop();
  /// Call when the outputs are safe: a second signal may then end the program.
  void allow_leaving() noexcept;
};

}  // namespace abs_hil::program

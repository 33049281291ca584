#pragma once

#include "abs_hil/rig/reason.hpp"

namespace abs_hil::app {

/// From now on SIGINT, SIGTERM and SIGHUP are noted instead of ending the program, and SIGPIPE is ignored.
void note_signals();
/// The stop that a signal has asked for; `none` if there was none.
[[nodiscard]] rig::Reason signalled() noexcept;

}  // namespace abs_hil::app

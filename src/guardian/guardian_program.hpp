// What the two guardian programs have in common.
#pragma once

#include <initializer_list>

#include "config/settings.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::guardian {

inline constexpr int exit_verified = 0;
inline constexpr int exit_not_verified = 1;
inline constexpr int exit_usage = 2;
inline constexpr int exit_not_started = 3;

/// Signals from a terminal or a closed pipe must not end a guardian.
void ignore_signals(std::initializer_list<int> signals);
/// Exempts this process from the kernel's out-of-memory killer. This needs CAP_SYS_RESOURCE; failure is ignored.
void spare_from_oom();
/// One priority above the controller's: a controller in an endless loop must not block its guardian.
[[nodiscard]] runtime::RealtimeOptions realtime_options(const config::Settings& settings, runtime::RealtimeMode mode);

/// True if abs_hil started this program as the guardian of one run.
[[nodiscard]] bool started_by_a_run();
/// The guardian of one run. Returns the exit status.
[[nodiscard]] int guard_one_run();

/// `abs_guardian serve ...`: the resident service. Returns the exit status.
[[nodiscard]] int serve(int argc, const char* const* argv);

}  // namespace abs_hil::guardian

#pragma once

#include <initializer_list>
#include <string>

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
/// "require", "off", or anything else for "prefer".
[[nodiscard]] runtime::RealtimeMode realtime_mode_of(const std::string& name);

}  // namespace abs_hil::guardian

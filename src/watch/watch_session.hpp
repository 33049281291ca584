#pragma once

#include <functional>
#include <string>

namespace abs_hil::watch {

/// Options of `abs_hil watch`.
struct WatchOptions {
  std::string url{};           ///< empty: LCM_DEFAULT_URL, else UDP multicast within this computer
  std::string prefix{"ABS_"};  ///< prefix of the channel names
  double window_s{10.0};       ///< width of the plots, in [1, 60]
  bool ascii{false};           ///< no braille or Greek letters, even if the terminal has them
  bool plain{false};           ///< one line per second instead of a screen; always without a terminal
  bool once{false};            ///< one screen as text, then end
  double once_timeout_s{5.0};  ///< longest wait for it, > 0
};

/// How watching ended.
enum class WatchEnd {
  quit,              ///< `q` was typed, the screen was shown once, or the output was closed
  stopped,           ///< `stop` returned true
  nothing_received,  ///< no message arrived in time
};

/// Watches until `q` is typed, `stop` returns true (it is called at least ten times a second) or, with `once`, a screen
/// has been shown. Throws telemetry::LcmError, std::invalid_argument for an option out of range, and std::runtime_error
/// for an unusable terminal.
[[nodiscard]] WatchEnd watch(const WatchOptions& options, const std::function<bool()>& stop);

}  // namespace abs_hil::watch

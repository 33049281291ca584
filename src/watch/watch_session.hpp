#pragma once

#include <functional>
#include <string>

namespace abs_hil::watch {

/// What to watch, and how.
struct WatchOptions {
  std::string url{};           ///< empty: LCM_DEFAULT_URL, else UDP multicast within this computer
  std::string prefix{"ABS_"};  ///< of the channels
  double window_s{10.0};       ///< width of the plots, in [1, 60]
  bool ascii{false};           ///< no braille or Greek letters even where the terminal has them
  bool plain{false};           ///< a line a second instead of a screen; without a terminal always
  bool once{false};            ///< one picture as text, then end
  double once_timeout_s{5.0};  ///< how long to wait for it, > 0
};

/// How watching ended.
enum class WatchEnd {
  quit,              ///< `q`, or the picture was shown, or nobody reads any more
  stopped,           ///< `stop` said so
  nothing_received,  ///< no picture: no message came
};

/// Watches until `q` is typed, `stop` returns true (asked at least ten times a second) or, with `once`, there is a
/// picture. Throws telemetry::LcmError, std::invalid_argument for an option out of range, and std::runtime_error for a
/// terminal that cannot be used.
[[nodiscard]] WatchEnd watch(const WatchOptions& options, const std::function<bool()>& stop);

}  // namespace abs_hil::watch

#pragma once

#include <cstdint>
#include <type_traits>

#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/reason.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "runtime/plausibility_limits.hpp"

namespace abs_hil::runtime {

// select_asked() is for code that goes on only `if (rig::any(asked))`. A single run then knows that the condition
// holds, so nothing is left to ask. In a pack it holds in some lanes alone. Real-time safe.

/// `asked && answer`.
template <class Condition>
[[nodiscard, gnu::always_inline]] constexpr Condition select_asked(const Condition& asked,
                                                                   const Condition& answer) noexcept {
  if constexpr (std::is_same_v<Condition, bool>) {
    return answer;
  } else {
    return asked && answer;
  }
}

/// `asked ? a : b`.
template <class Condition, class S>
[[nodiscard, gnu::always_inline]] constexpr S select_asked(const Condition& asked, const S& a, const S& b) noexcept {
  if constexpr (std::is_same_v<Condition, bool>) {
    return a;
  } else {
    return rig::select(asked, a, b);
  }
}

/// Result of a plausibility check: the fault found, or none.
struct CheckResult {
  rig::Reason reason{rig::Reason::none};
  double value{0.0};
  [[nodiscard]] bool sound() const noexcept { return reason == rig::Reason::none; }
};

/// Mean speeds and commands over about 2 ms, which is long enough for the encoders to resolve a speed. `S` is a
/// `double`, or a pack of them (rig/scalar.hpp).
template <class S>
struct BasicSpeedWindow {
  S dt_s{0.0};
  S omega1_rad_s{0.0};  ///< mean over the window, from counts alone
  S omega2_rad_s{0.0};
  S resolution_rad_s{0.0};  ///< speed that corresponds to two counts in this time
  S begin_error_s{0.0};     ///< uncertainty of the stamp with which the window began
  S end_error_s{0.0};       ///< uncertainty of the stamp with which it ended
  S brake_target_Nm{0.0};   ///< mean of b(u); with an ideal actuator mean of the commanded torque
  S motor_duty{0.0};        ///< mean
  S motor_stall_Nm{0.0};    ///< stall torque at that duty

  /// Uncertainty of the window's duration.
  [[nodiscard]] S stamp_error_s() const noexcept { return begin_error_s + end_error_s; }
};
using SpeedWindow = BasicSpeedWindow<double>;

/// Duration of the shortest speed window: a little less than two cycles at 1 kHz, so that jitter does not make it
/// three. docs/safety.md, "Where the bounds come from", derives it and the resolution.
inline constexpr std::int64_t least_speed_window_ns = 1'800'000;
inline constexpr double resolution_counts = 2.0;

/// The window in which the counters moved by these counts.
template <class S>
[[nodiscard]] inline BasicSpeedWindow<S> speed_window_over(const S& dt_s, const S& rad_per_count, const S& upper_counts,
                                                           const S& lower_counts, const S& brake_impulse_Nms,
                                                           const S& motor_duty_s) noexcept {
  const S rad_s_per_count = rad_per_count / dt_s;
  return {.dt_s = dt_s,
          .omega1_rad_s = upper_counts * rad_s_per_count,
          .omega2_rad_s = lower_counts * rad_s_per_count,
          .resolution_rad_s = resolution_counts * rad_s_per_count,
          .brake_target_Nm = brake_impulse_Nms / dt_s,
          .motor_duty = motor_duty_s / dt_s};
}

/// Checks whether measurements are fresh and combines them into speed windows. A window lasts until its speeds are
/// certain enough to be judged. Real-time safe.
class SpeedWindows {
 public:
  explicit SpeedWindows(const PlausibilityLimits& limits);

  /// Takes a measurement and the command that has acted since the previous one.
  /// @param now_ns      the cycle's wake-up, on the clock of the time stamps; the reading began then
  /// @param reading_ns  how long the reading took; the counters were latched within this time
  CheckResult update(const rig::Measurement& measurement, std::int64_t now_ns, const rig::Command& sent,
                     std::int64_t reading_ns = 0) noexcept;
  /// True if the latest measurement may be used: it is fresh and no counter jumped.
  [[nodiscard]] bool usable() const noexcept { return usable_; }
  /// True if the latest update completed a speed window.
  [[nodiscard]] bool complete() const noexcept { return complete_; }
  /// True if a speed window is due, but the latest measurement did not complete it: it is stale, or its speeds are too
  /// uncertain. The checks cannot judge the wheels then.
  [[nodiscard]] bool overdue() const noexcept { return overdue_; }
  [[nodiscard]] const SpeedWindow& speed_window() const noexcept { return speed_window_; }
  /// A travel of so many counts is no leap, however short its time.
  [[nodiscard]] std::int32_t sure_counts() const noexcept { return sure_counts_; }
  /// Shortest window whose counts resolve a speed.
  [[nodiscard]] std::int64_t resolving_ns() const noexcept { return resolving_ns_; }

 private:
  [[nodiscard]] bool fresh(std::int64_t stamp_ns, std::int64_t now_ns) noexcept;
  /// The fault if a counter has moved faster than any wheel can, in `since_s` and the slack.
  [[nodiscard]] CheckResult leaps(std::int32_t upper_travel, std::int32_t lower_travel, double since_s) const noexcept;
  void begin(const rig::Measurement& measurement) noexcept;
  /// Integral of b(u) over a time under the sent command, N m s; of the duties that act in it.
  [[nodiscard]] double impulse_Nms(const rig::Command& sent, double time_s) noexcept;

  PlausibilityLimits limits_;
  rig::BrakeDelay delay_;
  double most_counts_per_s_;  ///< of a counter that does not leap
  std::int32_t sure_counts_;
  std::int64_t resolving_ns_;
  bool started_{false};
  bool usable_{true};
  bool complete_{false};
  bool overdue_{false};
  int stale_cycles_{0};
  std::int64_t fresh_ns_{0};  ///< the cycle of the latest fresh measurement
  std::int64_t stamp_ns_{0};  ///< its stamp
  std::int64_t stamp_error_ns_{0};
  std::int32_t upper_{0};  ///< its counts
  std::int32_t lower_{0};
  std::int64_t begin_ns_{0};  ///< start of the current speed window
  std::int64_t begin_error_ns_{0};
  std::int32_t begin_upper_{0};
  std::int32_t begin_lower_{0};
  double brake_impulse_Nms_{0.0};  ///< integral of b(u) over the speed window
  double motor_duty_s_{0.0};
  SpeedWindow speed_window_{};
};

}  // namespace abs_hil::runtime

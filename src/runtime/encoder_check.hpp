#pragma once

#include <cstdint>

#include "runtime/speed_window.hpp"
#include "runtime/wheel_watch.hpp"

namespace abs_hil::runtime {

/// Interval of the speeds that one wheel can have. It widens as fast as physics lets the wheel gain and lose speed, and
/// each sound reading narrows it. A locking wheel stays inside; a reading outside is a fault. Real-time safe.
class SpeedInterval {
 public:
  enum class Verdict : std::uint8_t { sound, stuck, reversed, jumped, too_fast };

  SpeedInterval(double gain_rad_s2, double loss_rad_s2, double fastest_rad_s) noexcept
      : bounds_(gain_rad_s2, loss_rad_s2, fastest_rad_s), fastest_rad_s_(fastest_rad_s) {}

  /// Takes a mean speed over `dt_s`; `resolution_rad_s` is its uncertainty from counting, `stamp_error_s` < `dt_s` that
  /// of `dt_s`. The verdict differs from `sound` only after three readings in a row outside the interval, or above the
  /// fastest speed: the counts tell that without any observer.
  Verdict update(double omega_rad_s, double resolution_rad_s, double dt_s, double stamp_error_s = 0.0) noexcept;
  /// True if the latest reading was outside the interval.
  [[nodiscard]] bool doubtful() const noexcept { return outside_ > 0; }

 private:
  SpeedBounds<double> bounds_;
  double fastest_rad_s_;
  int outside_{0};   ///< number of readings in a row outside the interval
  int too_fast_{0};  ///< number of readings in a row above the fastest speed
};

/// The ways that both wheels' treads have covered while a condition held, for a comparison over more than one speed
/// window. The uncertainty then comes from the two ends alone.
struct Travelled {
  double lasted_s{0.0};  ///< 0: the condition does not hold, and the next window begins anew
  double upper_m{0.0};
  double lower_m{0.0};
  double begin_error_s{0.0};
  double end_error_s{0.0};
  double resolution_rad{0.0};  ///< two counts

  void add(const SpeedWindow& speed_window, const rig::WheelParameters& wheels) noexcept;
  [[nodiscard]] double stamp_share() const noexcept { return (begin_error_s + end_error_s) / lasted_s; }
};

/// Finds encoders that are stuck, jump, count backwards or wrongly, are swapped or lost. Real-time safe.
class EncoderCheck {
 public:
  explicit EncoderCheck(const PlausibilityLimits& limits) noexcept;

  CheckResult update(const SpeedWindow& speed_window) noexcept;
  /// The comparisons of the wheels rest while the wheels are apart, and afterwards until both roll again.
  void note_wheels_apart(bool apart) noexcept;
  /// True if one of the latest speeds was outside what its wheel can reach.
  [[nodiscard]] bool doubtful() const noexcept { return upper_.doubtful() || lower_.doubtful(); }
  /// Brake torque expected from the map (7) and the lag (6), N m.
  [[nodiscard]] double brake_torque_Nm() const noexcept { return watch_.brake_Nm(); }

 private:
  [[nodiscard]] CheckResult judge_speeds(const SpeedWindow& speed_window) noexcept;
  [[nodiscard]] CheckResult judge_parted(const SpeedWindow& speed_window) noexcept;
  [[nodiscard]] CheckResult judge_standing(const SpeedWindow& speed_window) noexcept;
  [[nodiscard]] CheckResult judge_rolling(const SpeedWindow& speed_window) noexcept;
  [[nodiscard]] CheckResult judge_slip(const SpeedWindow& speed_window) noexcept;

  PlausibilityLimits limits_;
  SpeedInterval upper_;
  SpeedInterval lower_;
  WheelWatch<double> watch_;
  bool compares_{true};  ///< the wheels have touched for long enough to be compared
  bool apart_{false};
  double together_s_{0.0};    ///< time since the wheels were joined
  double standing_s_{0.0};    ///< time for which the upper wheel has stood still although the tyre must spin it up
  double standing_rad_{0.0};  ///< its way in this time
  Travelled disagreeing_{};
  double allowed_m_{0.0};  ///< by how much the ways may differ while `disagreeing_`
  Travelled ahead_{};      ///< while the braked wheel is faster than the lower one
};

}  // namespace abs_hil::runtime

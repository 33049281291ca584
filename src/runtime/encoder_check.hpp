#pragma once

#include <cstdint>

#include "runtime/speed_window.hpp"

namespace abs_hil::runtime {

/// The speeds that one wheel can have, as an interval: it widens as fast as physics lets the wheel gain and lose speed,
/// and each sound reading narrows it. A reading outside it cannot be true, a wheel that locks stays inside. Real-time
/// safe.
class SpeedInterval {
 public:
  enum class Verdict : std::uint8_t { sound, stuck, reversed, jumped };

  SpeedInterval(double gain_rad_s2, double loss_rad_s2, double fastest_rad_s) noexcept
      : gain_rad_s2_(gain_rad_s2), loss_rad_s2_(loss_rad_s2), high_rad_s_(fastest_rad_s) {}

  /// Takes a mean speed over `dt_s`; `resolution_rad_s` is its uncertainty by counts. Other than `sound` once three
  /// readings in a row were outside.
  Verdict update(double omega_rad_s, double resolution_rad_s, double dt_s) noexcept;
  /// The latest reading was outside.
  [[nodiscard]] bool doubtful() const noexcept { return outside_ > 0; }

 private:
  double gain_rad_s2_;
  double loss_rad_s2_;
  double low_rad_s_{0.0};
  double high_rad_s_;
  int outside_{0};  ///< readings in a row
};

/// Encoders that are stuck, jump, count backwards or wrongly, are swapped or lost. Real-time safe.
class EncoderCheck {
 public:
  explicit EncoderCheck(const PlausibilityLimits& limits) noexcept;

  CheckResult update(const SpeedWindow& speed_window) noexcept;
  /// Brake torque that should act, by map and lag, N m.
  [[nodiscard]] double brake_torque_Nm() const noexcept { return brake_Nm_; }

 private:
  [[nodiscard]] CheckResult judge_speeds(const SpeedWindow& speed_window) noexcept;
  [[nodiscard]] CheckResult judge_rolling(const SpeedWindow& speed_window) noexcept;
  [[nodiscard]] CheckResult judge_slip(const SpeedWindow& speed_window) noexcept;

  PlausibilityLimits limits_;
  SpeedInterval upper_;
  SpeedInterval lower_;
  double brake_Nm_{0.0};
  double free_s_;         ///< since the brake was released
  double braked_s_{0.0};  ///< since the brake has been acting in earnest
  double disagreeing_s_{0.0};
  double ahead_s_{0.0};  ///< since the braked wheel has been the faster one
};

}  // namespace abs_hil::runtime

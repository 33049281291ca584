#pragma once

#include "runtime/speed_window.hpp"

namespace abs_hil::runtime {

/// Checks that motor and brake have the effect that their commands should have, by the momentum
/// p = J1 w1 / r1 + J2 w2 / r2 of both wheels. The tyre force cancels in p, on any road:
/// p' = motor/r2 - (brake + friction)/r1 - friction/r2. It compares the means of p over windows of 0.1 s, or of up
/// to 1 s if time stamps or counts make p less certain. Real-time safe.
class ResponseCheck {
 public:
  explicit ResponseCheck(const PlausibilityLimits& limits) noexcept : limits_(limits) {}

  /// @param brake_Nm expected brake torque
  CheckResult update(const SpeedWindow& speed_window, double brake_Nm) noexcept;
  /// A wheel that is apart from the other one stops sooner under the brake: the check of the brake allows for it.
  void note_wheels_apart(bool apart) noexcept { apart_ = apart; }

 private:
  /// Sums over one window.
  struct Window {
    double lasted_s{0.0};
    double travel_kg_m{0.0};    ///< integral of p
    double upper_kg_m{0.0};     ///< the upper wheel's part of it, while the wheels are apart
    double motor_kg_m_s{0.0};   ///< impulse that the motor should give, less twice the friction
    double brake_kg_m_s{0.0};   ///< impulse that the brake should take
    double begin_error_s{0.0};  ///< uncertainty of the stamps at its ends
    double end_error_s{0.0};
    double counts_rad{0.0};  ///< two counts
    double least_brake_Nm{1e9};
    double most_brake_Nm{0.0};
    double most_duty{0.0};  ///< largest duty of the motor
    bool rolls{true};       ///< the upper wheel's speed is at least half of rolling speed
    bool apart{false};      ///< the wheels were apart in some of it
  };
  /// Uncertainty of the window's mean momentum, kg m/s.
  [[nodiscard]] double slack_kg_m_s(const Window& window) const noexcept;
  [[nodiscard]] CheckResult judge(const Window& before, const Window& now) const noexcept;

  PlausibilityLimits limits_;
  bool apart_{false};
  Window before_{};
  Window now_{};
};

}  // namespace abs_hil::runtime

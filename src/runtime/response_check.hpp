#pragma once

#include "runtime/speed_window.hpp"

namespace abs_hil::runtime {

/// Commands against what they bring about, by the momentum p = J1 w1 / r1 + J2 w2 / r2 of both wheels. The tyre force
/// is inside it and cancels, whatever the road: p' = motor/r2 - (brake + friction)/r1 - friction/r2. Compares the means
/// of p over windows of 0.1 s. Real-time safe.
class ResponseCheck {
 public:
  explicit ResponseCheck(const PlausibilityLimits& limits) noexcept : limits_(limits) {}

  /// @param brake_Nm torque that should act
  CheckResult update(const SpeedWindow& speed_window, double brake_Nm) noexcept;

 private:
  /// Sums over one window.
  struct Window {
    double lasted_s{0.0};
    double travel_kg_m{0.0};   ///< integral of p
    double motor_kg_m_s{0.0};  ///< impulse that the motor should give, less twice the friction
    double brake_kg_m_s{0.0};  ///< impulse that the brake should take
    double least_brake_Nm{1e9};
    double most_brake_Nm{0.0};
    double most_duty{0.0};  ///< of the motor
    bool rolls{true};       ///< the upper wheel turns at least half as fast as it would roll
  };
  [[nodiscard]] CheckResult judge(const Window& before, const Window& now) const noexcept;

  PlausibilityLimits limits_;
  Window before_{};
  Window now_{};
};

}  // namespace abs_hil::runtime

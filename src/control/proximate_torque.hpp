// The torque that brings e_v to 0 through a slow brake.
#pragma once

#include <algorithm>
#include <cmath>

namespace abs_hil::control {

/// Torque that brings e_v' = (r1/J1) (T - hold) to e_v = 0 with a brake that is slow: near the target in proportion to
/// the error, far from it almost as fast as the brake can (proximate time-optimal control, Workman 1987). While the
/// torque returns to `hold` at the rate a, the error moves on by z^2 / (2 a J1/r1) for an excess z. So z =
/// sqrt(2 a (J1/r1) |e|) is the largest excess from which the error still ends at 0.
struct ProximateTorque {
  double mass_kg_m{0.0};        ///< J1/r1
  double gain_per_s{0.0};       ///< decay of a large error
  double near_per_s{0.0};       ///< decay of a small error
  double near_m_s{0.0};         ///< error at which the gain is half way between; > 0
  double swing_per_s{0.0};      ///< the brake's c31
  double rate_limit_Nm_s{0.0};  ///< of the brake; may be infinite

  /// Excess over the holding torque, as a size.
  /// @param error_m_s  size of e_v
  /// @param room_Nm  from the holding torque to the end of the range that the torque must use to return, > 0
  /// @param authority  part of the limit that is used, in (0, 1]
  [[nodiscard]] double excess_Nm(double error_m_s, double room_Nm, double authority) const noexcept {
    const double gain = near_per_s + (gain_per_s - near_per_s) * error_m_s / (error_m_s + near_m_s);
    const double rate = std::min(swing_per_s * room_Nm, rate_limit_Nm_s);
    return std::min(gain * mass_kg_m * error_m_s, authority * std::sqrt(2.0 * rate * mass_kg_m * error_m_s));
  }
};

}  // namespace abs_hil::control

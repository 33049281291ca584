#pragma once

#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::rig {

/// Distance that the car has covered since braking started, by the trapezoidal rule on v_x. `S` is a `double`, or a
/// pack of them (scalar.hpp).
template <class S>
class BrakingDistance {
 public:
  /// @param braking  the cycle is in phase brake
  template <class Condition>
  void note(const S& time_s, const S& v_x_m_s, const Condition& braking) noexcept {
    const S way_m = 0.5 * (last_m_s_ + v_x_m_s) * (time_s - last_s_);
    distance_m_ = select(begun_ > 0.0, S(distance_m_ + way_m), distance_m_);
    begun_ = select(braking, S(1.0), begun_);
    last_s_ = time_s;
    last_m_s_ = v_x_m_s;
  }
  [[nodiscard]] S distance_m() const noexcept { return distance_m_; }

 private:
  S begun_{0.0};  ///< 1 once the car brakes
  S last_s_{0.0};
  S last_m_s_{0.0};
  S distance_m_{0.0};
};

}  // namespace abs_hil::rig

#pragma once

#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// I of (16)-(17), I' = e_v, by the trapezoidal rule over the measured interval. Anti-windup: I is held over
/// an interval if the torque sent for it was not the reference torque and e_v would drive the two further apart.
/// Real-time safe.
class SlipErrorIntegral {
 public:
  /// I = 0 at the start of braking.
  void reset(double error_m_s, double slip_ref) noexcept;
  /// Integrates up to `input`, whose error against `slip_ref` is `error_m_s`.
  /// @param v_x_m_s  car speed; it gives the error against the reference of the past interval
  void advance(const SlipInput& input, double error_m_s, double slip_ref, double v_x_m_s) noexcept;

  [[nodiscard]] double value_m() const noexcept { return value_m_; }
  /// Means over the last interval, for the adaptation.
  [[nodiscard]] double mean_value_m() const noexcept { return mean_value_m_; }
  [[nodiscard]] double mean_error_m_s() const noexcept { return mean_error_m_s_; }

 private:
  double value_m_{0.0};
  double mean_value_m_{0.0};
  double mean_error_m_s_{0.0};
  double error_m_s_{0.0};
  double slip_ref_{0.0};
};

}  // namespace abs_hil::control

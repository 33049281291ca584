#pragma once

#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// I of (16)-(17), I' = e_v, by the trapezoidal rule over the measured interval. Anti-windup: I is held while the
/// reference torque is outside the actuator's range and e_v would drive it further out. Real-time safe.
class SlipErrorIntegral {
 public:
  /// I = 0 at the start of braking.
  void reset(double error_m_s, double slip_ref) noexcept;
  /// Integrates up to `input`, whose error is `error_m_s`.
  /// @param v_x_m_s  car speed; it gives the error against the reference of the past interval
  void advance(double dt_s, double error_m_s, double slip_ref, double v_x_m_s) noexcept;
  /// Stores the reference torque until the next `advance`, and compares it with the range [0, max_torque_Nm].
  void note_request(double torque_Nm, double max_torque_Nm) noexcept {
    if (torque_Nm > max_torque_Nm) {
      request_ = Request::above;
    } else if (torque_Nm < 0.0) {
      request_ = Request::below;
    } else {
      request_ = Request::within_range;
    }
  }

  [[nodiscard]] double value_m() const noexcept { return value_m_; }
  /// Means over the last interval, for the adaptation.
  [[nodiscard]] double mean_value_m() const noexcept { return mean_value_m_; }
  [[nodiscard]] double mean_error_m_s() const noexcept { return mean_error_m_s_; }

 private:
  enum class Request { within_range, above, below };

  double value_m_{0.0};
  double mean_value_m_{0.0};
  double mean_error_m_s_{0.0};
  double error_m_s_{0.0};
  double slip_ref_{0.0};
  Request request_{Request::within_range};
};

}  // namespace abs_hil::control

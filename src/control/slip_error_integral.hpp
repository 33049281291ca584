// The integral I of the slip velocity error, which does not wind up.
#pragma once

#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// I of (16)-(17), I' = e_v, by the trapezoidal rule over the measured interval. Anti-windup: I is held over
/// an interval if the torque sent for it was not the reference torque and e_v would drive the two further apart.
/// Real-time safe.
template <class S>
class BasicSlipErrorIntegral {
 public:
  /// I = 0 at the start of braking.
  void reset(const S& error_m_s, const S& slip_ref) noexcept {
    *this = {};
    error_m_s_ = error_m_s;
    mean_error_m_s_ = error_m_s;
    slip_ref_ = slip_ref;
  }

  /// Integrates up to `input`, whose error against `slip_ref` is `error_m_s`.
  /// @param v_x_m_s  car speed; it gives the error against the reference of the past interval
  void advance(const BasicSlipInput<S>& input, const S& error_m_s, const S& slip_ref, const S& v_x_m_s) noexcept {
    // A change of the reference now makes e_v jump. The past interval must not include this jump.
    const S error_before_change = error_m_s + (slip_ref - slip_ref_) * v_x_m_s;
    mean_error_m_s_ = 0.5 * (error_m_s_ + error_before_change);
    error_m_s_ = error_m_s;
    slip_ref_ = slip_ref;

    // The torque contains -ks0 I: a negative error raises it, a positive error lowers it.
    const auto winds_up = input.unsent_torque_Nm * mean_error_m_s_ < 0.0;
    const S increment_m = rig::select(winds_up, S(0.0), S(mean_error_m_s_ * input.dt_s));
    mean_value_m_ = value_m_ + 0.5 * increment_m;
    value_m_ += increment_m;
  }

  [[nodiscard]] S value_m() const noexcept { return value_m_; }
  /// Means over the last interval, for the adaptation.
  [[nodiscard]] S mean_value_m() const noexcept { return mean_value_m_; }
  [[nodiscard]] S mean_error_m_s() const noexcept { return mean_error_m_s_; }

 private:
  S value_m_{0.0};
  S mean_value_m_{0.0};
  S mean_error_m_s_{0.0};
  S error_m_s_{0.0};
  S slip_ref_{0.0};
};
using SlipErrorIntegral = BasicSlipErrorIntegral<double>;

}  // namespace abs_hil::control

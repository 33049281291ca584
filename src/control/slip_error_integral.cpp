#include "control/slip_error_integral.hpp"

namespace abs_hil::control {

void SlipErrorIntegral::reset(double error_m_s, double slip_ref) noexcept {
  *this = SlipErrorIntegral{};
  error_m_s_ = error_m_s;
  mean_error_m_s_ = error_m_s;
  slip_ref_ = slip_ref;
}

void SlipErrorIntegral::advance(const SlipInput& input, double error_m_s, double slip_ref, double v_x_m_s) noexcept {
  // A change of the reference now makes e_v jump. The past interval must not include this jump.
  const double error_before_change = error_m_s + (slip_ref - slip_ref_) * v_x_m_s;
  mean_error_m_s_ = 0.5 * (error_m_s_ + error_before_change);
  error_m_s_ = error_m_s;
  slip_ref_ = slip_ref;

  // The torque contains -ks0 I: a negative error raises it, a positive error lowers it.
  const bool winds_up = input.unsent_torque_Nm * mean_error_m_s_ < 0.0;
  const double increment_m = winds_up ? 0.0 : mean_error_m_s_ * input.dt_s;
  mean_value_m_ = value_m_ + 0.5 * increment_m;
  value_m_ += increment_m;
}

}  // namespace abs_hil::control

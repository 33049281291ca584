#include "control/pi_controller.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

double measured_equivalent_torque_Nm(const rig::WheelParameters& wheels, const SlipInput& input) noexcept {
  const auto& w = wheels;
  const double tyre_force_N =
      std::max(0.0, -(w.J2_kg_m2 * input.alpha2_rad_s2 + w.d2_Nms_rad * input.speeds.omega2_rad_s + w.M20_Nm) / w.r2_m);
  return w.J1_kg_m2 / w.r1_m *
         (slip_velocity_gain(w, input.slip_ref) * tyre_force_N + friction_drift_m_s2(w, input.speeds, input.slip_ref));
}

PiController::PiController(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      kp_per_s_{-std::expm1(-context.options.pi.kp_per_s / context.options.rate_Hz) * context.options.rate_Hz},
      ki_per_s2_{context.options.pi.ki_per_s2},
      feed_forward_{context.options.pi.feed_forward} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  rig::require_valid(context.options.pi, "control.pi.");
}

void PiController::reset(const SlipInput& input) noexcept {
  integral_.reset(slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref), input.slip_ref);
}

SlipOutput PiController::step(const SlipInput& input) noexcept {
  const double error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref);
  integral_.advance(input, error_m_s, input.slip_ref, wheels_.r2_m * input.speeds.omega2_rad_s);
  const double feedback_m_s2 = -kp_per_s_ * error_m_s - ki_per_s2_ * integral_.value_m();
  const double torque_Nm =
      feed_forward_ * measured_equivalent_torque_Nm(wheels_, input) + wheels_.J1_kg_m2 / wheels_.r1_m * feedback_m_s2;
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = rig::unknown};
}

bool PiController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const PiController*>(&before);
  if (other == nullptr) return false;
  integral_ = other->integral_;
  return true;
}

}  // namespace abs_hil::control

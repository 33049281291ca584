#include "control/nominal_controller.hpp"

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

NominalController::NominalController(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      tyre_{context.rig.tyre},
      dynamics_{context},
      theta0_N_{context.options.nominal.theta0_N != 0.0 ? context.options.nominal.theta0_N : context.rig.tyre.theta_N} {
  rig::require_valid(context.options.nominal, "control.nominal.");
}

void NominalController::reset(const SlipInput& input) noexcept {
  integral_.reset(slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref), input.slip_ref);
}

SlipOutput NominalController::step(const SlipInput& input) noexcept {
  const double error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref);
  integral_.advance(input, error_m_s, input.slip_ref, wheels_.r2_m * input.speeds.omega2_rad_s);

  const double phi = rig::normalised_tyre_force(tyre_, input.slip);
  const double torque_Nm =
      dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta0_N_, phi);
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta0_N_};
}

bool NominalController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const NominalController*>(&before);
  if (other == nullptr) return false;
  integral_ = other->integral_;
  return true;
}

}  // namespace abs_hil::control

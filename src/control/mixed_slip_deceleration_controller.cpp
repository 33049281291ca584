#include "control/mixed_slip_deceleration_controller.hpp"

#include <algorithm>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/full_torque.hpp"
#include "control/standing_wheel.hpp"

namespace abs_hil::control {
namespace {
constexpr double g_m_s2 = 9.81;
}  // namespace

MixedSlipDecelerationController::MixedSlipDecelerationController(const ControllerContext& context)
    : wheels_{context.rig.wheels}, brake_{context.rig.brake}, options_{context.options.mixed_slip_deceleration} {
  rig::require_valid(options_, "control.mixed_slip_deceleration.");
}

void MixedSlipDecelerationController::reset(const SlipInput&) noexcept { integral_Nm_ = 0.0; }

SlipOutput MixedSlipDecelerationController::step(const SlipInput& input) noexcept {
  const bool turning = turns(input.speeds.omega1_rad_s);
  const double deceleration = turning ? -wheels_.r1_m * input.alpha1_rad_s2 / g_m_s2 : 0.0;
  const double error = options_.target - (input.slip + options_.weight * deceleration);
  const double full_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm);
  // Where less was sent than asked for, the integral must not grow, and the other way round.
  if (!(input.unsent_torque_Nm * error > 0.0)) {
    integral_Nm_ = std::clamp(integral_Nm_ + options_.ki_Nm_s * error * input.dt_s, 0.0, full_Nm);
  }
  return {.brake_torque_Nm = std::clamp(options_.kp_Nm * error + integral_Nm_, 0.0, full_Nm),
          .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

bool MixedSlipDecelerationController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const MixedSlipDecelerationController*>(&before);
  if (other == nullptr) return false;
  integral_Nm_ = other->integral_Nm_;
  return true;
}

}  // namespace abs_hil::control

#include "control/locked_controller.hpp"

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/full_torque.hpp"

namespace abs_hil::control {

LockedController::LockedController(const ControllerContext& context) noexcept
    : wheels_{context.rig.wheels}, brake_{context.rig.brake} {}

void LockedController::reset(const SlipInput&) noexcept {}

SlipOutput LockedController::step(const SlipInput& input) noexcept {
  return {.brake_torque_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm),
          .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace abs_hil::control

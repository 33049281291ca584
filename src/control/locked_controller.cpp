#include "abs_hil/control/locked_controller.hpp"

#include <cmath>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::control {

LockedController::LockedController(const ControllerContext& context) noexcept
    : wheels_{context.rig.wheels}, full_torque_Nm_{rig::brake_torque_at(context.rig.brake, 1.0)} {}

void LockedController::reset(const SlipInput&) noexcept {}

SlipOutput LockedController::step(const SlipInput& input) noexcept {
  const double torque_Nm = std::isinf(input.max_brake_torque_Nm) ? full_torque_Nm_ : input.max_brake_torque_Nm;
  return {.brake_torque_Nm = torque_Nm,
          .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace abs_hil::control

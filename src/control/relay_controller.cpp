#include "control/relay_controller.hpp"

#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/full_torque.hpp"

namespace abs_hil::control {

RelayController::RelayController(const ControllerContext& context)
    : wheels_{context.rig.wheels}, brake_{context.rig.brake}, threshold_{context.options.relay.threshold} {
  rig::require_valid(context.options.relay, "control.relay.");
}

void RelayController::reset(const SlipInput&) noexcept {}

SlipOutput RelayController::step(const SlipInput& input) noexcept {
  const double threshold = threshold_ > 0.0 ? threshold_ : input.slip_ref;
  return {.brake_torque_Nm = input.slip > threshold ? 0.0 : full_torque_Nm(brake_, input.max_brake_torque_Nm),
          .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

bool RelayController::take_over(const SlipController& before) noexcept {
  return dynamic_cast<const RelayController*>(&before) != nullptr;
}

}  // namespace abs_hil::control

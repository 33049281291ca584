#include "proportional_controller.hpp"

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"

namespace example {

using namespace abs_hil;

ProportionalController::ProportionalController(const control::ControllerContext& context, const Options& options)
    : wheels_{context.rig.wheels}, options_{options} {
  rig::require_valid(options_, "control.proportional.");
}

void ProportionalController::reset(const control::SlipInput&) noexcept {}

control::SlipOutput ProportionalController::step(const control::SlipInput& input) noexcept {
  return {.brake_torque_Nm = options_.base_Nm + options_.gain_Nm * (input.slip_ref - input.slip),
          .slip_velocity_error_m_s = control::slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace example

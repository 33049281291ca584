#include "proportional_controller.hpp"

#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"

namespace example {

using namespace abs_hil;

ProportionalController::ProportionalController(const control::ControllerContext& context,
                                               const ProportionalOptions& options)
    : wheels_{context.rig.wheels}, options_{options} {
  if (!(options.base_Nm >= 0.0)) throw std::invalid_argument("base_Nm must be >= 0");
  if (!(options.gain_Nm > 0.0)) throw std::invalid_argument("gain_Nm must be > 0");
}

void ProportionalController::reset(const control::SlipInput&) noexcept {}

control::SlipOutput ProportionalController::step(const control::SlipInput& input) noexcept {
  return {.brake_torque_Nm = options_.base_Nm + options_.gain_Nm * (input.slip_ref - input.slip),
          .slip_velocity_error_m_s = control::slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace example

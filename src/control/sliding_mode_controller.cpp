#include "control/sliding_mode_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

SlidingModeController::SlidingModeController(const ControllerContext& context)
    : surface_{context, context.options.sliding_mode.adaptation}, gain_m_s2_{context.options.sliding_mode.gain_m_s2} {
  rig::require_valid(context.options.sliding_mode, "control.sliding_mode.");
}

SlipOutput SlidingModeController::step(const SlipInput& input) noexcept {
  const double error_m_s = surface_.observe(input);
  const double sign = error_m_s > 0.0 ? 1.0 : (error_m_s < 0.0 ? -1.0 : 0.0);
  const double rate_m_s2 = -gain_m_s2_ * sign;
  const WantedMotion wanted{.mean_rate_m_s2 = rate_m_s2,
                            .error_at_mid_m_s = error_m_s + 0.5 * surface_.period_s() * rate_m_s2};
  return surface_.drive(input, error_m_s, wanted, sign);
}

bool SlidingModeController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const SlidingModeController*>(&before);
  if (other == nullptr) return false;
  surface_.take_over(other->surface_);
  return true;
}

}  // namespace abs_hil::control

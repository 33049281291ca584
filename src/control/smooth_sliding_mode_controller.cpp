#include "control/smooth_sliding_mode_controller.hpp"

#include <algorithm>
#include <cmath>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

double boundary_layer_motion_m_s(double error_m_s, double gain_m_s2, double width_m_s, double time_s) noexcept {
  const double size = std::abs(error_m_s);
  const double outside_s = std::max(0.0, (size - width_m_s) / gain_m_s2);
  if (time_s <= outside_s) return std::copysign(size - gain_m_s2 * time_s, error_m_s);
  const double inside_s = time_s - outside_s;
  return std::copysign(std::min(size, width_m_s) * std::exp(-gain_m_s2 / width_m_s * inside_s), error_m_s);
}

WantedMotion boundary_layer_reference(double error_m_s, double gain_m_s2, double width_m_s, double period_s) noexcept {
  const double error_at_end_m_s = boundary_layer_motion_m_s(error_m_s, gain_m_s2, width_m_s, period_s);
  return {.mean_rate_m_s2 = (error_at_end_m_s - error_m_s) / period_s,
          .error_at_mid_m_s = boundary_layer_motion_m_s(error_m_s, gain_m_s2, width_m_s, 0.5 * period_s)};
}

SmoothSlidingModeController::SmoothSlidingModeController(const ControllerContext& context)
    : surface_{context, context.options.sliding_mode_smooth.adaptation},
      gain_m_s2_{context.options.sliding_mode_smooth.gain_m_s2},
      width_m_s_{context.options.sliding_mode_smooth.boundary_m_s} {
  rig::require_valid(context.options.sliding_mode_smooth, "control.sliding_mode_smooth.");
}

SlipOutput SmoothSlidingModeController::step(const SlipInput& input) noexcept {
  const double error_m_s = surface_.observe(input);
  const WantedMotion wanted = boundary_layer_reference(error_m_s, gain_m_s2_, width_m_s_, surface_.period_s());
  return surface_.drive(input, error_m_s, wanted, -wanted.mean_rate_m_s2 / gain_m_s2_);
}

bool SmoothSlidingModeController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const SmoothSlidingModeController*>(&before);
  if (other == nullptr) return false;
  surface_.take_over(other->surface_);
  return true;
}

}  // namespace abs_hil::control

#include "control/super_twisting_controller.hpp"

#include <algorithm>
#include <cmath>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

SuperTwistingStep super_twisting_step(double error_m_s, double integral_m_s2, double k1, double k2,
                                      double period_s) noexcept {
  const double h = period_s;
  const double size = std::abs(error_m_s);
  // sqrt|e+| of |e+| + h k1 sqrt|e+| = |e|, without the cancellation of -b + sqrt(b^2 + 4|e|).
  const double root = 2.0 * size / (h * k1 + std::sqrt(h * h * k1 * k1 + 4.0 * size));
  const double sign = std::clamp(error_m_s / (h * h * k2), -1.0, 1.0);
  return {.root_rate_m_s2 = std::copysign(k1 * root, -error_m_s),
          .integral_m_s2 = integral_m_s2 - h * k2 * sign,
          .sign = sign};
}

SuperTwistingController::SuperTwistingController(const ControllerContext& context)
    : surface_{context, context.options.super_twisting.adaptation},
      k1_{context.options.super_twisting.k1},
      k2_{context.options.super_twisting.k2} {
  rig::require_valid(context.options.super_twisting, "control.super_twisting.");
}

void SuperTwistingController::reset(const SlipInput& input) noexcept {
  surface_.reset(input);
  integral_m_s2_ = 0.0;
}

SlipOutput SuperTwistingController::step(const SlipInput& input) noexcept {
  const double error_m_s = surface_.observe(input);
  const double period_s = surface_.period_s();
  const SuperTwistingStep next = super_twisting_step(error_m_s, integral_m_s2_, k1_, k2_, period_s);
  // z compensates the model error, so only the root moves e_v.
  const WantedMotion wanted{.mean_rate_m_s2 = next.root_rate_m_s2 + next.integral_m_s2,
                            .error_at_mid_m_s = error_m_s + 0.5 * period_s * next.root_rate_m_s2};
  const SlipOutput output = surface_.drive(input, error_m_s, wanted, next.sign);
  if (!surface_.winds_up(next.integral_m_s2 - integral_m_s2_)) integral_m_s2_ = next.integral_m_s2;
  return output;
}

bool SuperTwistingController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const SuperTwistingController*>(&before);
  if (other == nullptr) return false;
  surface_.take_over(other->surface_);
  integral_m_s2_ = other->integral_m_s2_;
  return true;
}

}  // namespace abs_hil::control

#include "abs_hil/control/super_twisting_controller.hpp"

#include <cmath>
#include <stdexcept>

namespace abs_hil::control {

SuperTwistingStep super_twisting_step(double error_m_s, double integral_m_s2, double k1, double k2,
                                      double period_s) noexcept {
  // e+ + h k1 sqrt|e+| s + h^2 k2 s = e + h z with s in sign(e+): solved by e+ = 0 while the right side is within
  // h^2 k2, else quadratic in sqrt|e+|.
  const double h = period_s;
  const double right_side = error_m_s + h * integral_m_s2;
  const double reach = h * h * k2;
  if (std::abs(right_side) <= reach) {
    const double sign = right_side / reach;
    return {.error_m_s = 0.0, .integral_m_s2 = integral_m_s2 - h * k2 * sign, .sign = sign};
  }
  const double sign = std::copysign(1.0, right_side);
  const double rest = std::abs(right_side) - reach;
  // sqrt|e+| without the cancellation of -b + sqrt(b^2 + 4 rest).
  const double root = 2.0 * rest / (h * k1 + std::sqrt(h * h * k1 * k1 + 4.0 * rest));
  return {.error_m_s = sign * root * root, .integral_m_s2 = integral_m_s2 - h * k2 * sign, .sign = sign};
}

SuperTwistingController::SuperTwistingController(const ControllerContext& context)
    : surface_{context, context.options.super_twisting.adaptation},
      k1_{context.options.super_twisting.k1},
      k2_{context.options.super_twisting.k2} {
  if (!(k1_ > 0.0 && k2_ > 0.0)) throw std::invalid_argument("super_twisting.k1 and .k2 must be > 0");
}

void SuperTwistingController::reset(const SlipInput& input) noexcept {
  surface_.reset(input);
  integral_m_s2_ = 0.0;
}

SlipOutput SuperTwistingController::step(const SlipInput& input) noexcept {
  const double error_m_s = surface_.observe(input);
  const double period_s = surface_.period_s();
  const SuperTwistingStep next = super_twisting_step(error_m_s, integral_m_s2_, k1_, k2_, period_s);
  const WantedMotion wanted{.mean_rate_m_s2 = (next.error_m_s - error_m_s) / period_s,
                            .error_at_mid_m_s = 0.5 * (error_m_s + next.error_m_s)};
  const SlipOutput output = surface_.drive(input, error_m_s, wanted, next.sign);
  if (!surface_.winds_up(next.integral_m_s2 - integral_m_s2_)) integral_m_s2_ = next.integral_m_s2;
  return output;
}

}  // namespace abs_hil::control

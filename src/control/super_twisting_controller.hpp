// Super-twisting: a second-order sliding mode with a continuous torque.
#pragma once

#include "control/law_controller.hpp"
#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// One period of the super-twisting algorithm e' = -k1 sqrt|e| sign(e) + z, z' = -k2 sign(e).
template <class S>
struct SuperTwistingStep {
  S root_rate_m_s2{0.0};  ///< -k1 sqrt|e| sign(e), mean over the period
  S integral_m_s2{0.0};   ///< z for the period
  S sign{0.0};            ///< substitute for sign(e), in [-1, 1]
};

/// Semi-implicit step. sqrt|e| is taken at the period's end, where e+ = e - h k1 sqrt|e+| sign(e+). The sign is
/// sat(e/(h^2 k2)), so that the change of z never takes e beyond 0. The step is continuous in e and z. Close to 0 it
/// becomes the deadbeat pair u = z - 2 e/h, z+ = z - e/h. This ends the chatter at any rate and leaves e = O(h^2) under
/// a perturbation of bounded slope (docs/theory-baselines.md). Real-time safe.
template <class S>
[[nodiscard]] SuperTwistingStep<S> super_twisting_step(const S& error_m_s, const S& integral_m_s2, const S& k1,
                                                       const S& k2, const S& period_s) noexcept {
  const S& h = period_s;
  const S size = rig::magnitude(error_m_s);
  // sqrt|e+| of |e+| + h k1 sqrt|e+| = |e|, without the cancellation of -b + sqrt(b^2 + 4|e|).
  const S root = 2.0 * size / (h * k1 + rig::square_root(S(h * h * k1 * k1 + 4.0 * size)));
  const S sign = rig::clamped(S(error_m_s / (h * h * k2)), S(-1.0), S(1.0));
  return {.root_rate_m_s2 = rig::with_sign(S(k1 * root), S(-error_m_s)),
          .integral_m_s2 = integral_m_s2 - h * k2 * sign,
          .sign = sign};
}

/// Super-twisting slip control: the equivalent control of SlidingModeLaw, but with the continuous
///   -k1 sqrt|e_v| sign(e_v) + z,  z' = -k2 sign(e_v)
/// in place of -K sign(e_v). The law overcomes a model error rho with |rho'| <= L in finite time if k2 > L and
/// k1 > sqrt(k2 + L). z is held while the reference torque is outside the actuator's range and z would drive it further
/// out.
template <class S>
class SuperTwistingLaw {
 public:
  static constexpr bool estimates_theta = true;

  SuperTwistingLaw() = default;
  /// Throws std::invalid_argument for options out of range.
  explicit SuperTwistingLaw(const ControllerContext& context)
    requires std::is_same_v<S, double>;

  void reset(const BasicSlipInput<S>& input) noexcept {
    surface_.reset(input);
    integral_m_s2_ = S(0.0);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const S period_s = surface_.period_s();
    const SuperTwistingStep<S> next = super_twisting_step(error_m_s, integral_m_s2_, k1_, k2_, period_s);
    // z compensates the model error, so only the root moves e_v.
    const BasicWantedMotion<S> wanted{.mean_rate_m_s2 = next.root_rate_m_s2 + next.integral_m_s2,
                                      .error_at_mid_m_s = error_m_s + 0.5 * period_s * next.root_rate_m_s2};
    const BasicSlipOutput<S> output = surface_.drive(input, error_m_s, wanted, next.sign);
    const auto held = surface_.winds_up(S(next.integral_m_s2 - integral_m_s2_));
    integral_m_s2_ = rig::select(held, integral_m_s2_, next.integral_m_s2);
    return output;
  }
  void take_over(const SuperTwistingLaw& before) noexcept {
    surface_.take_over(before.surface_);
    integral_m_s2_ = before.integral_m_s2_;
  }

 private:
  BasicSlidingSurface<S> surface_{};
  S k1_{0.0};
  S k2_{0.0};
  S integral_m_s2_{0.0};
};

class SuperTwistingController final : public LawController<SuperTwistingLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control

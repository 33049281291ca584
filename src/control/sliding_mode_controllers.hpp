// The sliding-mode laws: with the sign of e_v, with a boundary layer, and super-twisting.
#pragma once

#include "abs_hil/rig/option_check.hpp"
#include "control/law_controller.hpp"
#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// Sliding-mode slip control, the type of the paper's own baseline:
///   Tb = (J1/r1) xi_1 of (18), with nu = -K sign(e_v) - q e_v in place of -ks0 I - ks1 e_v; q is 0 by default,
///   theta_hat' = -gamma k(slip_ref) phi(slip) sign(e_v), projected.
/// The law and the gains of the paper's baseline are not public. This is the textbook law for the error (13), not a
/// copy. The sign is held for a period, so e_v chatters around 0 with an amplitude of about K times the period. The
/// chatter belongs to the law.
template <class S>
class SlidingModeLaw {
 public:
  static constexpr bool estimates_theta = true;

  SlidingModeLaw() = default;
  explicit SlidingModeLaw(const ControllerContext& context)
      : surface_{context, context.options.sliding_mode.adaptation},
        gain_m_s2_{context.options.sliding_mode.gain_m_s2},
        reaching_per_s_{context.options.sliding_mode.reaching_per_s} {
    rig::require_valid(context.options.sliding_mode, "control.sliding_mode.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept { surface_.reset(input); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const S sign = rig::select(error_m_s > 0.0, S(1.0), rig::select(error_m_s < 0.0, S(-1.0), S(0.0)));
    const S rate_m_s2 = -gain_m_s2_ * sign - reaching_per_s_ * error_m_s;
    const BasicWantedMotion<S> wanted{.mean_rate_m_s2 = rate_m_s2,
                                      .error_at_mid_m_s = error_m_s + 0.5 * surface_.period_s() * rate_m_s2};
    return surface_.drive(input, error_m_s, wanted, sign);
  }
  void take_over(const SlidingModeLaw& before) noexcept { surface_.take_over(before.surface_); }

 private:
  BasicSlidingSurface<S> surface_{};
  S gain_m_s2_{0.0};
  S reaching_per_s_{0.0};
};

/// Closed-form solution e_v of e_v' = -K sat(e_v/width) after `time_s`. |e_v| falls at the rate K outside the boundary
/// layer of that width, and exponentially inside it. Real-time safe.
template <class S>
[[nodiscard]] S boundary_layer_motion_m_s(const S& error_m_s, const S& gain_m_s2, const S& width_m_s,
                                          const S& time_s) noexcept {
  const S size = rig::magnitude(error_m_s);
  const S outside_s = rig::larger(S(0.0), S((size - width_m_s) / gain_m_s2));
  const S inside_s = time_s - outside_s;
  const S outside = size - gain_m_s2 * time_s;
  const S inside = rig::smaller(size, width_m_s) * rig::exponential(S(-gain_m_s2 / width_m_s * inside_s));
  return rig::with_sign(rig::select(time_s <= outside_s, outside, inside), error_m_s);
}

/// The motion of e_v over a period, by that solution. Real-time safe.
template <class S>
[[nodiscard]] BasicWantedMotion<S> boundary_layer_reference(const S& error_m_s, const S& gain_m_s2, const S& width_m_s,
                                                            const S& period_s) noexcept {
  const S error_at_end_m_s = boundary_layer_motion_m_s(error_m_s, gain_m_s2, width_m_s, period_s);
  return {.mean_rate_m_s2 = (error_at_end_m_s - error_m_s) / period_s,
          .error_at_mid_m_s = boundary_layer_motion_m_s(error_m_s, gain_m_s2, width_m_s, S(0.5 * period_s))};
}

/// SlidingModeLaw with a boundary layer: sat(e_v/width) replaces sign(e_v), so that the torque is continuous in e_v.
/// The law of the paper's own sliding-mode baseline is not public. In sampled form the mean of e_v' over a period is
/// that of the closed-form solution above. This is stable for any width and rate. For width -> 0 it becomes the
/// implicit (backward Euler) form of the sign, which does not chatter.
template <class S>
class SmoothSlidingModeLaw {
 public:
  static constexpr bool estimates_theta = true;

  SmoothSlidingModeLaw() = default;
  explicit SmoothSlidingModeLaw(const ControllerContext& context)
      : surface_{context, context.options.sliding_mode_smooth.adaptation},
        gain_m_s2_{context.options.sliding_mode_smooth.gain_m_s2},
        width_m_s_{context.options.sliding_mode_smooth.boundary_m_s} {
    rig::require_valid(context.options.sliding_mode_smooth, "control.sliding_mode_smooth.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept { surface_.reset(input); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const BasicWantedMotion<S> wanted =
        boundary_layer_reference(error_m_s, gain_m_s2_, width_m_s_, surface_.period_s());
    return surface_.drive(input, error_m_s, wanted, S(-wanted.mean_rate_m_s2 / gain_m_s2_));
  }
  void take_over(const SmoothSlidingModeLaw& before) noexcept { surface_.take_over(before.surface_); }

 private:
  BasicSlidingSurface<S> surface_{};
  S gain_m_s2_{0.0};
  S width_m_s_{0.0};
};

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
  explicit SuperTwistingLaw(const ControllerContext& context)
      : surface_{context, context.options.super_twisting.adaptation},
        k1_{context.options.super_twisting.k1},
        k2_{context.options.super_twisting.k2} {
    rig::require_valid(context.options.super_twisting, "control.super_twisting.");
  }

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

}  // namespace abs_hil::control

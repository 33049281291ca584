// The sliding mode with a boundary layer.
#pragma once

#include "control/law_controller.hpp"
#include "control/sliding_surface.hpp"

namespace abs_hil::control {

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
  /// Throws std::invalid_argument for options out of range.
  explicit SmoothSlidingModeLaw(const ControllerContext& context)
    requires std::is_same_v<S, double>;

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

class SmoothSlidingModeController final : public LawController<SmoothSlidingModeLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control

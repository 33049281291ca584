#pragma once

#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// Closed-form solution e_v of e_v' = -K sat(e_v/width) after `time_s`. |e_v| falls at the rate K outside the boundary
/// layer of that width, and exponentially inside it. Real-time safe.
[[nodiscard]] double boundary_layer_motion_m_s(double error_m_s, double gain_m_s2, double width_m_s,
                                               double time_s) noexcept;

/// The motion of e_v over a period, by that solution. Real-time safe.
[[nodiscard]] WantedMotion boundary_layer_reference(double error_m_s, double gain_m_s2, double width_m_s,
                                                    double period_s) noexcept;

/// SlidingModeController with a boundary layer: sat(e_v/width) replaces sign(e_v), so that the torque is continuous in
/// e_v. The law of the paper's own sliding-mode baseline is not public. In sampled form the mean of e_v' over a period
/// is that of the closed-form solution above. This is stable for any width and rate. For width -> 0 it becomes the
/// implicit (backward Euler) form of the sign, which does not chatter.
class SmoothSlidingModeController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit SmoothSlidingModeController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override { surface_.reset(input); }
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  BasicSlidingSurface<double> surface_;
  double gain_m_s2_;
  double width_m_s_;
};

}  // namespace abs_hil::control

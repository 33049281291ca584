#pragma once

#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// e_v after `time_s` on e_v' = -K sat(e_v/width), in closed form: |e_v| falls at K down to the layer of that width and
/// exponentially inside it. Real-time safe.
[[nodiscard]] double boundary_layer_motion_m_s(double error_m_s, double gain_m_s2, double width_m_s,
                                               double time_s) noexcept;

/// SlidingModeController with a boundary layer: sat(e_v/width) in the place of sign(e_v), so that the torque is
/// continuous in e_v. The law of the paper's own sliding-mode baseline is not public. Sampled: the mean of e_v' over a
/// period is that of the exact motion above, which is stable for any width and rate; for width -> 0 it becomes the
/// implicit (backward Euler) form of the sign, which does not chatter.
class SmoothSlidingModeController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit SmoothSlidingModeController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override { surface_.reset(input); }
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  SlidingSurface surface_;
  double gain_m_s2_;
  double width_m_s_;
};

}  // namespace abs_hil::control

#include "control/smooth_sliding_mode_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
SmoothSlidingModeLaw<S>::SmoothSlidingModeLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : surface_{context, context.options.sliding_mode_smooth.adaptation},
      gain_m_s2_{context.options.sliding_mode_smooth.gain_m_s2},
      width_m_s_{context.options.sliding_mode_smooth.boundary_m_s} {
  rig::require_valid(context.options.sliding_mode_smooth, "control.sliding_mode_smooth.");
}

template class SmoothSlidingModeLaw<double>;

}  // namespace abs_hil::control

#include "control/sliding_mode_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
SlidingModeLaw<S>::SlidingModeLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : surface_{context, context.options.sliding_mode.adaptation}, gain_m_s2_{context.options.sliding_mode.gain_m_s2} {
  rig::require_valid(context.options.sliding_mode, "control.sliding_mode.");
}

template class SlidingModeLaw<double>;

}  // namespace abs_hil::control

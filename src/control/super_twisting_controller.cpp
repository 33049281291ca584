#include "control/super_twisting_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
SuperTwistingLaw<S>::SuperTwistingLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : surface_{context, context.options.super_twisting.adaptation},
      k1_{context.options.super_twisting.k1},
      k2_{context.options.super_twisting.k2} {
  rig::require_valid(context.options.super_twisting, "control.super_twisting.");
}

template class SuperTwistingLaw<double>;

}  // namespace abs_hil::control

#include "control/mixed_slip_deceleration_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
MixedSlipDecelerationLaw<S>::MixedSlipDecelerationLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      brake_{context.rig.brake},
      weight_{context.options.mixed_slip_deceleration.weight},
      target_{context.options.mixed_slip_deceleration.target},
      kp_Nm_{context.options.mixed_slip_deceleration.kp_Nm},
      ki_Nm_s_{context.options.mixed_slip_deceleration.ki_Nm_s} {
  rig::require_valid(context.options.mixed_slip_deceleration, "control.mixed_slip_deceleration.");
}

template class MixedSlipDecelerationLaw<double>;

}  // namespace abs_hil::control

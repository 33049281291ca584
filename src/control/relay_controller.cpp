#include "control/relay_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
RelayLaw<S>::RelayLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)}, brake_{context.rig.brake}, threshold_{context.options.relay.threshold} {
  rig::require_valid(context.options.relay, "control.relay.");
}

template class RelayLaw<double>;

}  // namespace abs_hil::control

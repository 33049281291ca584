#include "control/nominal_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
NominalLaw<S>::NominalLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      dynamics_{context},
      theta0_N_{context.options.nominal.theta0_N != 0.0 ? context.options.nominal.theta0_N : context.rig.tyre.theta_N} {
  rig::require_valid(context.options.nominal, "control.nominal.");
}

template class NominalLaw<double>;

}  // namespace abs_hil::control

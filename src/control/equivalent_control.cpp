#include "abs_hil/control/equivalent_control.hpp"

#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
BasicEquivalentControl<S>::BasicEquivalentControl(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      v_min_m_s_{context.options.v_min_m_s},
      half_period_s_{0.5 / context.options.rate_Hz} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  rig::require_valid(context.options, &ControlOptions::v_min_m_s, "control.");
}

template class BasicEquivalentControl<double>;

}  // namespace abs_hil::control

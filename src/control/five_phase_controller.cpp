#include "control/five_phase_controller.hpp"

#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
FivePhaseLaw<S>::FivePhaseLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      brake_{context.rig.brake},
      hold_below_m_s2_{context.options.five_phase.hold_below_m_s2},
      release_below_m_s2_{context.options.five_phase.release_below_m_s2},
      recover_above_m_s2_{context.options.five_phase.recover_above_m_s2},
      reapply_below_m_s2_{context.options.five_phase.reapply_below_m_s2},
      hold_limit_s_{context.options.five_phase.hold_limit_s},
      recover_limit_s_{context.options.five_phase.recover_limit_s},
      apply_Nm_s_{context.options.five_phase.apply_Nm_s},
      release_Nm_s_{context.options.five_phase.release_Nm_s},
      reapply_Nm_s_{context.options.five_phase.reapply_Nm_s},
      period_s_{1.0 / context.options.rate_Hz} {
  rig::require_valid(context.options.five_phase, "control.five_phase.");
  if (!(release_below_m_s2_ <= hold_below_m_s2_)) {
    throw std::invalid_argument("control.five_phase.release_below_m_s2 must not be above hold_below_m_s2");
  }
  if (!(recover_above_m_s2_ > release_below_m_s2_)) {
    throw std::invalid_argument("control.five_phase.recover_above_m_s2 must be above release_below_m_s2");
  }
  if (!(reapply_below_m_s2_ > hold_below_m_s2_)) {
    throw std::invalid_argument("control.five_phase.reapply_below_m_s2 must be above hold_below_m_s2");
  }
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
}

template class FivePhaseLaw<double>;

}  // namespace abs_hil::control

#include "control/pi_controller.hpp"

#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
PiLaw<S>::PiLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      kp_per_s_{-std::expm1(-context.options.pi.kp_per_s / context.options.rate_Hz) * context.options.rate_Hz},
      ki_per_s2_{context.options.pi.ki_per_s2},
      feed_forward_{context.options.pi.feed_forward} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  rig::require_valid(context.options.pi, "control.pi.");
}

template class PiLaw<double>;

}  // namespace abs_hil::control

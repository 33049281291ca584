#include "control/sliding_mode_actuator_controller.hpp"

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
SlidingModeActuatorLaw<S>::SlidingModeActuatorLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      surface_{context, context.options.sliding_mode_actuator.adaptation},
      wheels_observer_{context.options.sliding_mode_actuator.observer, context.rig, context.options.rate_Hz},
      gain_m_s2_{context.options.sliding_mode_actuator.gain_m_s2},
      width_m_s_{context.options.sliding_mode_actuator.boundary_m_s},
      lag_decay_per_s_{
          rig::exponential_less_one(-context.options.sliding_mode_actuator.lag_gain_per_s / context.options.rate_Hz) *
          context.options.rate_Hz},
      gamma_{context.options.sliding_mode_actuator.adaptation.gamma},
      v_min_m_s_{context.options.v_min_m_s} {
  rig::require_valid(context.options.sliding_mode_actuator, "control.sliding_mode_actuator.");
}

template class SlidingModeActuatorLaw<double>;

}  // namespace abs_hil::control

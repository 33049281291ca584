#include "control/adaptive_actuator_controller.hpp"

#include <cmath>

#include "abs_hil/rig/option_check.hpp"
#include "control/adaptive_gains.hpp"

namespace abs_hil::control {
namespace {

/// Copies this controller's gains to the options of AdaptiveController, whose parts it shares.
ControlOptions with_own_gains(const ControlOptions& options) {
  const AdaptiveActuatorOptions& own = options.adaptive_actuator;
  rig::require_valid(own, &AdaptiveActuatorOptions::lag_gain_per_s, "control.adaptive_actuator.");
  rig::require_valid(own, &AdaptiveActuatorOptions::lag_weight_s2, "control.adaptive_actuator.");
  ControlOptions result = options;
  result.adaptive = own.law;
  return result;
}

}  // namespace

template <class S>
AdaptiveActuatorLaw<S>::AdaptiveActuatorLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      lag_decay_per_s_{std::expm1(-context.options.adaptive_actuator.lag_gain_per_s / context.options.rate_Hz) *
                       context.options.rate_Hz},
      lag_weight_{context.options.adaptive_actuator.lag_weight_s2},
      v_min_m_s_{context.options.v_min_m_s},
      period_s_{1.0 / context.options.rate_Hz},
      dynamics_{{with_own_gains(context.options), context.rig}},
      gains_{paper_gains(context.options.adaptive_actuator.law)},
      theta_{context.options.adaptive_actuator.law, context.rig.wheels},
      wheels_observer_{context.options.adaptive_actuator.observer, context.rig, context.options.rate_Hz} {}

template class AdaptiveActuatorLaw<double>;

}  // namespace abs_hil::control

// The adaptive law (17)-(18) behind the brake's lag and dead time, with gains that follow from the dead time.
#pragma once

#include "control/adaptive_actuator_controller.hpp"

namespace abs_hil::control {

/// AdaptiveActuatorLaw, which acts on the predicted state, with gains by the rule of `predicted_gains` in place of
/// Table 1's: ks1 is the largest gain of the slip and ks0 = ks1^2/4, so that e_v returns fastest without overshoot,
/// and `lag_gain_per_s` is the largest gain of the torque. Below a dead time of 16 ms they stay as
/// they are there, since the observer's own delay counts, too. It has no keys of its own: the rig's file makes it
/// usable. With a right model (17) and (18) hold at t + Td, but theta_hat is that of t (docs/theory-beyond.md).
template <class S>
class AdaptivePredictorLaw : public AdaptiveActuatorLaw<S> {
 public:
  AdaptivePredictorLaw() = default;
  /// Throws std::invalid_argument as AdaptiveActuatorLaw does.
  explicit AdaptivePredictorLaw(const ControllerContext& context);
};

}  // namespace abs_hil::control

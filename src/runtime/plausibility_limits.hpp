#pragma once

#include "abs_hil/rig/parameters.hpp"
#include "runtime/gate_options.hpp"

namespace abs_hil::runtime {

/// Bounds of what physics allows this rig. They come from its nominal parameters, with a factor of 2 for their
/// uncertainty (docs/safety.md derives each). `enabled` false: nothing is checked.
struct PlausibilityLimits {
  bool enabled{false};
  double rad_per_count{0.0};
  double upper_gain_rad_s2{0.0};  ///< fastest gain of speed of the upper wheel: the tyre alone
  double upper_loss_rad_s2{0.0};  ///< fastest loss: tyre, full brake and friction; infinite with an ideal actuator
  double lower_gain_rad_s2{0.0};  ///< tyre and motor
  double lower_loss_rad_s2{0.0};  ///< tyre and friction
  double released_brake_Nm{0.0};  ///< brake torque with which a sliding tyre spins up a standing upper wheel
  double overspeed_rad_s{0.0};
  double sample_age_max_s{0.0};
  double free_slip_max{0.0};
  bool ideal_actuator{false};
  rig::WheelParameters wheels{};
  rig::BrakeParameters brake{};
  rig::DriveMotorParameters motor{};
};

[[nodiscard]] PlausibilityLimits plausibility_limits(const rig::RigParameters& rig, bool ideal_actuator,
                                                     const GateOptions& options);

}  // namespace abs_hil::runtime

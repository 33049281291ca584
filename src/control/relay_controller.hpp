#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// Relay as in the rig maker's demonstration: no torque while the slip is above a threshold, otherwise full torque (as
/// LockedController). It has no state and so no hysteresis. theta_est_N is NaN.
class RelayController final : public SlipController {
 public:
  /// Throws std::invalid_argument for a threshold outside [0, 1).
  explicit RelayController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  rig::WheelParameters wheels_;
  rig::BrakeParameters brake_;
  double threshold_;
};

}  // namespace abs_hil::control

#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// Full brake torque at any slip: braking without ABS, the reference for the slip controllers. The torque is the
/// actuator's largest, or b(1) of (7) if the actuator has no limit. theta_est_N is NaN.
class LockedController final : public SlipController {
 public:
  explicit LockedController(const ControllerContext& context) noexcept;

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;

 private:
  rig::WheelParameters wheels_;
  rig::BrakeParameters brake_;
};

}  // namespace abs_hil::control

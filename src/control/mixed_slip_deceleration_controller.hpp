#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// Mixed slip-deceleration control (Savaresi, Tanelli and Cantoni, 2007): a PI controller holds
///   slip + weight * (deceleration of the upper wheel's circumference in g)
/// at one value. With a constant wheel slip the wheel decelerates as the car does, so the held slip is smaller where
/// the tyre grips more. The deceleration also answers a torque at once, and damps the loop. It estimates nothing.
/// A standing wheel has slip 1 and no deceleration. theta_est_N is NaN.
class MixedSlipDecelerationController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit MixedSlipDecelerationController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  rig::WheelParameters wheels_;
  rig::BrakeParameters brake_;
  MixedSlipDecelerationOptions options_;
  double integral_Nm_{0.0};
};

}  // namespace abs_hil::control

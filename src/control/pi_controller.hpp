#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "control/slip_error_integral.hpp"

namespace abs_hil::control {

/// Brake torque that keeps e_v constant by (14): (J1/r1)(k F + friction drift). The lower wheel's deceleration gives
/// the tyre force F = -(J2 omega2' + d2 omega2 + M20)/r2, taken as >= 0. This needs no tyre model and no theta.
/// Real-time safe.
[[nodiscard]] double measured_equivalent_torque_Nm(const rig::WheelParameters& wheels, const SlipInput& input) noexcept;

/// Speed-scheduled PI with feed-forward. The slip responds faster to a torque when the car is slower: slip' ~ (r1/J1)
/// Tb/v_x. So the gains on the slip error are proportional to v_x, and the scaled error is e_v = v_x (slip - slip_ref):
///   Tb = feed_forward * (measured equivalent torque) - (J1/r1) ( Kp e_v + ki I ),  I' = e_v,
/// SlipErrorIntegral gives I and its anti-windup. Kp = (1 - exp(-kp h))/h for a period h, so that the proportional part
/// alone reduces e_v by exp(-kp h) in each period at any rate. theta_est_N is NaN.
class PiController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit PiController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  rig::WheelParameters wheels_;
  double kp_per_s_;
  double ki_per_s2_;
  double feed_forward_;
  SlipErrorIntegral integral_;
};

}  // namespace abs_hil::control

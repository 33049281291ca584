#pragma once

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "control/slip_error_integral.hpp"

namespace abs_hil::control {

/// Brake torque that, by (14), would keep e_v as it is under the tyre force that the lower wheel's deceleration tells,
/// F = -(J2 omega2' + d2 omega2 + M20)/r2, taken as >= 0: (J1/r1)(k F + friction drift). No tyre model and no theta.
/// Real-time safe.
[[nodiscard]] double measured_equivalent_torque_Nm(const rig::WheelParameters& wheels, const SlipInput& input) noexcept;

/// Speed-scheduled PI with feed-forward. The slip answers a torque the faster, the slower the car: slip' ~ (r1/J1)
/// Tb/v_x. So the gains on the slip error are scheduled with v_x, which turns it into e_v = v_x (slip - slip_ref):
///   Tb = feed_forward * (measured equivalent torque) - (J1/r1) ( Kp e_v + ki I ),  I' = e_v,
/// with I and its anti-windup by SlipErrorIntegral, and Kp = (1 - exp(-kp h))/h for a period h, so that the
/// proportional part alone makes e_v fall by exp(-kp h) a period at any rate. theta_est_N is NaN.
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

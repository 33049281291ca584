#pragma once

#include "control/sliding_surface.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// SmoothSlidingModeController stepped back through the brake's lag (6), as AdaptiveActuatorController does with (17):
/// alpha is the torque of the sliding-mode law, and eta = (r1/J1)(Tb - alpha) is the error that the lag leaves, in
/// m/s^2. The static torque reference is
///   b = Tb + (1/c31) ( alpha' - (J1/r1) lag_gain eta ),
/// with alpha' from the model at theta_hat, so eta' = -lag_gain eta and e_v' = -K sat(e_v/width) + eta - k phi
/// theta_err. The speeds are those of a force observer, which the brake torque is fed to. With an ideal actuator (no
/// limit, no lag) the output equals that of SmoothSlidingModeController with the same gains, bit for bit
/// (docs/theory-baselines.md).
class SlidingModeActuatorController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit SlidingModeActuatorController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  [[nodiscard]] SlipInput observed(const SlipInput& input) const noexcept;
  [[nodiscard]] double reference_rate_m_s3(const SlipInput& input, double error_m_s, double theta_N,
                                           double switching) const noexcept;

  rig::WheelParameters wheels_;
  rig::TyreParameters tyre_;
  SlidingModeActuatorOptions options_;
  BrakeLag lag_;
  BasicSlidingSurface<double> surface_;
  WheelForceObserver wheels_observer_;
  double v_min_m_s_;
};

}  // namespace abs_hil::control

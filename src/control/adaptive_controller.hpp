#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/slip_error_integral.hpp"
#include "control/theta_estimator.hpp"

namespace abs_hil::control {

/// Adaptive slip controller (17)-(18) of Theorem 3.1, `adaptive_T_b` and `adaptive_dot` of paper_laws.hpp in
/// sampled-data form. SlipErrorDynamics gives the torque, SlipErrorIntegral gives I, and ThetaEstimator gives
/// theta_hat. The estimator uses the brake torque that acts, not the reference. With an ideal actuator V = ([I; e_v]' P
/// [I; e_v] + (theta - theta_hat)^2/gamma)/2 never grows.
class AdaptiveController final : public SlipController {
 public:
  /// Throws std::invalid_argument for gains, Q or bounds of theta out of range.
  explicit AdaptiveController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  /// The states of (17), and V and V' of Theorem 3.1. V needs the true theta: these take the model's, so V falls as the
  /// theorem says only if the model's theta is right.
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  [[nodiscard]] rig::SignalValues states(double error_m_s, double phi) const noexcept;
  void adapt(const SlipInput& input, double past_phi) noexcept;

  rig::WheelParameters wheels_;
  rig::TyreParameters tyre_;
  SlipErrorDynamics dynamics_;
  paper::Gains<double> gains_;
  paper::Weights<double> weights_;
  SlipErrorIntegral integral_;
  ThetaEstimator theta_;
  double omega1_rad_s_{0.0};  ///< of the previous cycle, as is the slip
  double slip_{0.0};
};

}  // namespace abs_hil::control

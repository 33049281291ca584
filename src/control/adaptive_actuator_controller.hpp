#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/control/wheel_motion.hpp"
#include "control/slip_error_integral.hpp"
#include "control/theta_estimator.hpp"
#include "control/wheel_force_observer.hpp"

namespace abs_hil::control {

/// The adaptive controller (17)-(18) with the brake's lag (6) as a third step of backstepping (docs/theory-beyond.md):
/// alpha is the torque of (17), and eta = (r1/J1)(Tb - alpha) is the error that the lag leaves, in m/s^2. The static
/// torque reference,
///   b = Tb + (1/c31) ( alpha' - (J1/r1) ( lag_gain eta + B'P [I; e_v] / lag_weight ) ),
/// with alpha' from the model at theta_hat, and the tuning function zeta' = -gamma phi ( k B'P [I; e_v] + lag_weight a
/// eta ) give V' = -x'Qx - lag_weight lag_gain eta^2 - ka1 phi theta_err^2 for
///   V = ( x'Px + lag_weight eta^2 + theta_err^2 / gamma ) / 2.
/// While the command is limited, the integral is held and only the innovation adapts theta_hat. With an ideal actuator
/// (no limit, no lag) the output equals that of AdaptiveController with the same gains, bit for bit.
class AdaptiveActuatorController final : public SlipController {
 public:
  /// Throws std::invalid_argument for gains, Q or bounds of theta out of range.
  explicit AdaptiveActuatorController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  [[nodiscard]] SlipInput observed(const SlipInput& input) const noexcept;
  void adapt(const SlipInput& input, double past_phi) noexcept;
  [[nodiscard]] double zeta_rate_N_s(double slip_ref, double phi, double BtP_x) const noexcept;
  [[nodiscard]] double through_lag(const SlipInput& input, double wanted_Nm, double error_m_s) noexcept;
  [[nodiscard]] double wanted_rate_m_s3(const SlipInput& input, double error_m_s, double zeta_rate) const noexcept;
  [[nodiscard]] double wanted_rate_per_theta(const SlipInput& input) const noexcept;

  rig::WheelParameters wheels_;
  rig::TyreParameters tyre_;
  BrakeLag lag_;
  double lag_gain_;    ///< 1/s
  double lag_weight_;  ///< s^2
  double v_min_m_s_;
  double period_s_;
  SlipErrorDynamics dynamics_;
  paper::Gains<double> gains_;
  SlipErrorIntegral integral_;
  ThetaEstimator theta_;
  WheelForceObserver wheels_observer_;
  double omega1_rad_s_{0.0};  ///< of the previous cycle, as is the slip
  double slip_{0.0};
  double tuning_{0.0};   ///< lag_weight a eta of the previous cycle
  bool limited_{false};  ///< true if the previous command was not sent as it was
};

}  // namespace abs_hil::control

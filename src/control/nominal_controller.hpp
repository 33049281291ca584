#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/slip_error_integral.hpp"

namespace abs_hil::control {

/// Slip controller (16) for a known peak tyre force theta0: `nominal_T_b` of paper_laws.hpp in sampled-data form.
/// SlipErrorDynamics gives the torque, and SlipErrorIntegral gives I.
/// With the correct theta0 and an ideal actuator, e_v'' + ks1 e_v' + ks0 e_v = 0. theta_est_N is theta0.
class NominalController final : public SlipController {
 public:
  /// Throws std::invalid_argument for gains or theta0 out of range.
  explicit NominalController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  rig::WheelParameters wheels_;
  rig::TyreParameters tyre_;
  SlipErrorDynamics dynamics_;
  SlipErrorIntegral integral_;
  double theta0_N_;
};

}  // namespace abs_hil::control

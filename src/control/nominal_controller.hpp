// The paper's law (16) for a known peak tyre force.
#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/law_controller.hpp"
#include "control/slip_error_integral.hpp"

namespace abs_hil::control {

/// Slip controller (16) for a known peak tyre force theta0: `nominal_T_b` of paper_laws.hpp in sampled-data form.
/// SlipErrorDynamics gives the torque, and SlipErrorIntegral gives I.
/// With the correct theta0 and an ideal actuator, e_v'' + ks1 e_v' + ks0 e_v = 0. theta_est_N is theta0.
template <class S>
class NominalLaw {
 public:
  static constexpr bool estimates_theta = true;

  NominalLaw() = default;
  explicit NominalLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        tyre_{context.rig.tyre},
        dynamics_{context},
        theta0_N_{context.options.nominal.theta0_N != 0.0 ? context.options.nominal.theta0_N
                                                          : context.rig.tyre.theta_N} {
    rig::require_valid(context.options.nominal, "control.nominal.");
  }

  void reset(const BasicSlipInput<S>& input) noexcept {
    integral_.reset(slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref), input.slip_ref);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref);
    integral_.advance(input, error_m_s, input.slip_ref, laws_.r2 * input.speeds.omega2_rad_s);

    const S phi = rig::normalised_tyre_force(tyre_, input.slip);
    const S torque_Nm = dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta0_N_, phi);
    return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta0_N_};
  }
  void take_over(const NominalLaw& before) noexcept { integral_ = before.integral_; }

 private:
  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  BasicSlipErrorDynamics<S> dynamics_{};
  S theta0_N_{0.0};
  BasicSlipErrorIntegral<S> integral_{};
};

}  // namespace abs_hil::control

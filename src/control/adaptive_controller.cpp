#include "control/adaptive_controller.hpp"

#include <array>

#include "control/adaptive_gains.hpp"

namespace abs_hil::control {

template <class S>
AdaptiveLaw<S>::AdaptiveLaw(const ControllerContext& context)
  requires std::is_same_v<S, double>
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      theta_model_N_{context.rig.tyre.theta_N},
      dynamics_{context},
      gains_{paper_gains(context.options.adaptive)},
      weights_{paper_weights(context.options.adaptive)},
      theta_{context.options.adaptive, context.rig.wheels} {}

/// In the order of `signals`.
template <class S>
rig::SignalValues AdaptiveLaw<S>::states(double error_m_s) const noexcept
  requires std::is_same_v<S, double>
{
  using Laws = paper::Laws<double>;
  const double I = integral_.value_m();
  const double theta_err_N = theta_model_N_ - theta_.theta_N();
  return {I, theta_.omega1_hat_rad_s(omega1_rad_s_), theta_.zeta_N(),
          Laws::V(gains_, weights_, I, error_m_s, theta_err_N),
          Laws::V_dot(gains_, weights_, I, error_m_s, past_phi_, theta_err_N)};
}

template class AdaptiveLaw<double>;

SlipOutput AdaptiveController::step(const SlipInput& input) noexcept {
  SlipOutput output = law_.step(input);
  output.signals = law_.states(output.slip_velocity_error_m_s);
  return output;
}

std::span<const rig::Signal> AdaptiveController::signals() const noexcept {
  static constexpr std::array<rig::Signal, 5> rows{{
      {"I_m", "integral of the slip velocity error, I of (17), in m"},
      {"omega1_hat_rad_s", "upper wheel's speed in the estimator of (17), in rad/s"},
      {"zeta_N", "zeta of (17), in N"},
      {"V", "Lyapunov function of Theorem 3.1, with the model's theta"},
      {"V_dot", "its derivative V' by the theorem, with the model's theta and phi of the past interval"},
  }};
  return rows;
}

}  // namespace abs_hil::control

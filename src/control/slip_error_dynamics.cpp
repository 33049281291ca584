// The sampled gains of (14) by the matrix exponential, and the checks of the options that enter them.
#include "abs_hil/control/slip_error_dynamics.hpp"

#include <stdexcept>
#include <unsupported/Eigen/MatrixFunctions>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
BasicEquivalentControl<S>::BasicEquivalentControl(const ControllerContext& context)
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      v_min_m_s_{context.options.v_min_m_s},
      half_period_s_{0.5 / context.options.rate_Hz} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  rig::require_valid(context.options, &ControlOptions::v_min_m_s, "control.");
}

template class BasicEquivalentControl<double>;

Eigen::Matrix2d error_dynamics_matrix(double ks0, double ks1) {
  Eigen::Matrix2d A;
  A << 0.0, 1.0, -ks0, -ks1;
  return A;
}

template <class S>
BasicSlipErrorDynamics<S>::BasicSlipErrorDynamics(const ControllerContext& context) : equivalent_{context} {
  const auto& gains = context.options.adaptive;
  rig::require_valid(gains, &AdaptiveOptions::ks0, "control.adaptive.");
  rig::require_valid(gains, &AdaptiveOptions::ks1, "control.adaptive.");

  const Eigen::Matrix2d A = error_dynamics_matrix(gains.ks0, gains.ks1);
  const Eigen::Matrix2d half = (A * (0.5 * equivalent_.period_s())).exp();
  const Eigen::Matrix2d whole = half * half;
  const Eigen::RowVector2d mean_rate = (whole - Eigen::Matrix2d::Identity()).row(1) / equivalent_.period_s();
  sampled_gains_ = {.ks0 = -mean_rate[0], .ks1 = -mean_rate[1]};
  error_at_mid_ = {.per_s = half(1, 0), .share = half(1, 1)};
}

template class BasicSlipErrorDynamics<double>;

}  // namespace abs_hil::control

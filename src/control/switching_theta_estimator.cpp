#include "control/switching_theta_estimator.hpp"

#include <algorithm>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

SwitchingThetaEstimator::SwitchingThetaEstimator(const SwitchingAdaptationOptions& options)
    : gamma_{options.gamma},
      theta0_N_{options.theta0_N},
      theta_min_N_{options.theta_min_N},
      theta_max_N_{options.theta_max_N},
      theta_N_{options.theta0_N} {
  rig::require_valid(options, "");
  if (!(theta_min_N_ <= theta0_N_ && theta0_N_ <= theta_max_N_)) {
    throw std::invalid_argument("theta0_N must be in [theta_min_N, theta_max_N]");
  }
}

void SwitchingThetaEstimator::update(double dt_s, double gain_phi, double switching) noexcept {
  theta_N_ = std::clamp(theta_N_ - gamma_ * gain_phi * switching * dt_s, theta_min_N_, theta_max_N_);
}

}  // namespace abs_hil::control

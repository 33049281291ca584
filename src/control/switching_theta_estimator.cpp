#include "control/switching_theta_estimator.hpp"

#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

template <class S>
BasicSwitchingThetaEstimator<S>::BasicSwitchingThetaEstimator(const SwitchingAdaptationOptions& options)
  requires std::is_same_v<S, double>
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

template class BasicSwitchingThetaEstimator<double>;

}  // namespace abs_hil::control

#include "control/theta_estimator.hpp"

namespace abs_hil::control {

template <class S>
BasicThetaEstimator<S>::BasicThetaEstimator(const AdaptiveOptions& options, const rig::WheelParameters& wheels) noexcept
  requires std::is_same_v<S, double>
    : laws_{paper::laws(wheels)},
      innovation_gain_{options.gamma * options.ka1},
      zeta0_N_{rig::clamped(options.zeta0, options.theta_min_N, options.theta_max_N)},
      theta_min_N_{options.theta_min_N},
      theta_max_N_{options.theta_max_N},
      theta_N_{zeta0_N_},
      zeta_N_{zeta0_N_} {}

template class BasicThetaEstimator<double>;

}  // namespace abs_hil::control

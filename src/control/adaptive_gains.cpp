#include "control/adaptive_gains.hpp"

#include <cmath>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/lyapunov.hpp"

namespace abs_hil::control {

const AdaptiveOptions& checked(const AdaptiveOptions& options) {
  const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  if (!positive(options.gamma) || !positive(options.ka1)) {
    throw std::invalid_argument("adaptive.gamma and adaptive.ka1 must be > 0");
  }
  if (!(options.theta_min_N <= options.theta_max_N)) {
    throw std::invalid_argument("adaptive.theta_min_N must not exceed adaptive.theta_max_N");
  }
  if (!std::isfinite(options.zeta0)) throw std::invalid_argument("adaptive.zeta0 must be finite");
  return options;
}

Eigen::RowVector2d error_weights(const AdaptiveOptions& options) {
  Eigen::Matrix2d Q;
  Q << options.q11, options.q12, options.q12, options.q22;
  return solve_lyapunov(error_dynamics_matrix(options.ks0, options.ks1), Q).row(1);
}

}  // namespace abs_hil::control

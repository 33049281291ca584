#include "abs_hil/control/adaptive_gains.hpp"

#include <stdexcept>

#include "abs_hil/control/lyapunov.hpp"
#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

const AdaptiveOptions& checked(const AdaptiveOptions& options) {
  // Not the bounds of theta: without a projection, as in the paper's proofs, they lie beyond those of the
  // configuration.
  for (const auto member : {&AdaptiveOptions::gamma, &AdaptiveOptions::ka1, &AdaptiveOptions::zeta0}) {
    rig::require_valid(options, member, "control.adaptive.");
  }
  if (!(options.theta_min_N <= options.theta_max_N)) {
    throw std::invalid_argument("adaptive.theta_min_N must not exceed adaptive.theta_max_N");
  }
  return options;
}

Eigen::RowVector2d error_weights(const AdaptiveOptions& options) {
  Eigen::Matrix2d Q;
  Q << options.q11, options.q12, options.q12, options.q22;
  return solve_lyapunov(error_dynamics_matrix(options.ks0, options.ks1), Q).row(1);
}

}  // namespace abs_hil::control

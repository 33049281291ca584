#include "control/adaptive_gains.hpp"

#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/lyapunov.hpp"

namespace abs_hil::control {

const AdaptiveOptions& checked(const AdaptiveOptions& options) {
  // The bounds of theta are not checked. The paper's proofs have no projection, and tests of them use bounds outside
  // the ranges of the configuration.
  for (const auto member : {&AdaptiveOptions::gamma, &AdaptiveOptions::ka1, &AdaptiveOptions::zeta0}) {
    rig::require_valid(options, member, "control.adaptive.");
  }
  if (!(options.theta_min_N <= options.theta_max_N)) {
    throw std::invalid_argument("control.adaptive.theta_min_N must not exceed control.adaptive.theta_max_N");
  }
  return options;
}

paper::Gains<double> paper_gains(const AdaptiveOptions& options) {
  const AdaptiveOptions& o = checked(options);
  Eigen::Matrix2d Q;
  Q << o.q11, o.q12, o.q12, o.q22;
  const Eigen::RowVector2d B_transpose_P = solve_lyapunov(error_dynamics_matrix(o.ks0, o.ks1), Q).row(1);
  return {.ks0 = o.ks0, .ks1 = o.ks1, .gamma = o.gamma, .ka1 = o.ka1, .p12 = B_transpose_P[0], .p22 = B_transpose_P[1]};
}

}  // namespace abs_hil::control

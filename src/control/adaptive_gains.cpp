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

paper::Gains<double> paper_gains(const AdaptiveOptions& options) {
  const AdaptiveOptions& o = checked(options);
  Eigen::Matrix2d Q;
  Q << o.q11, o.q12, o.q12, o.q22;
  const Eigen::RowVector2d B_transpose_P = solve_lyapunov(error_dynamics_matrix(o.ks0, o.ks1), Q).row(1);
  return {.ks0 = o.ks0, .ks1 = o.ks1, .gamma = o.gamma, .ka1 = o.ka1, .p12 = B_transpose_P[0], .p22 = B_transpose_P[1]};
}

}  // namespace abs_hil::control

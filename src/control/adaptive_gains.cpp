// The gains of (16)-(18) from their options, and the checks of these.
#include "control/adaptive_gains.hpp"

#include <cmath>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/lyapunov.hpp"
#include "rig/formatted_text.hpp"

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

paper::Weights<double> paper_weights(const AdaptiveOptions& options) {
  const AdaptiveOptions& o = checked(options);
  Eigen::Matrix2d Q;
  Q << o.q11, o.q12, o.q12, o.q22;
  const Eigen::Matrix2d A = error_dynamics_matrix(o.ks0, o.ks1);
  // Q is judged first, by the solution for gains that are sound.
  static_cast<void>(solve_lyapunov(error_dynamics_matrix(1.0, 1.0), Q));
  Eigen::Matrix2d P;
  try {
    P = solve_lyapunov(A, Q);
  } catch (const std::invalid_argument&) {
    throw std::invalid_argument(rig::formatted(
        "control.adaptive.ks0 = %g 1/s^2 and control.adaptive.ks1 = %g 1/s are too far apart: PA + A'P = "
        "-2Q has no solution that a double can hold; bring ks1 nearer to sqrt(ks0) = %g 1/s",
        o.ks0, o.ks1, std::sqrt(o.ks0)));
  }
  return {.p11 = P(0, 0), .p12 = P(0, 1), .p22 = P(1, 1), .q11 = o.q11, .q12 = o.q12, .q22 = o.q22};
}

paper::Gains<double> paper_gains(const AdaptiveOptions& options) {
  const paper::Weights<double> w = paper_weights(options);
  const AdaptiveOptions& o = options;
  return {.ks0 = o.ks0, .ks1 = o.ks1, .gamma = o.gamma, .ka1 = o.ka1, .p12 = w.p12, .p22 = w.p22};
}

}  // namespace abs_hil::control

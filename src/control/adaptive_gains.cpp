// Solves the Lyapunov equation P A + A'P = -2 Q of Theorem 3.1 and checks the options that enter it.
#include "control/adaptive_gains.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <stdexcept>
#include <unsupported/Eigen/KroneckerProduct>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::control {

namespace {

bool is_positive_definite(const Eigen::Matrix2d& M) {
  const Eigen::LLT<Eigen::Matrix2d> cholesky{M};
  return M.allFinite() && cholesky.info() == Eigen::Success;
}

}  // namespace

Eigen::Matrix2d solve_lyapunov(const Eigen::Matrix2d& A, const Eigen::Matrix2d& Q) {
  if (!Q.allFinite() || !Q.isApprox(Q.transpose()) || !is_positive_definite(Q)) {
    throw std::invalid_argument(
        rig::formatted("Q = [%g %g; %g %g] is not valid; give a symmetric and positive definite Q: q11 > 0, q22 > 0, "
                       "q11 q22 > q12^2",
                       Q(0, 0), Q(0, 1), Q(1, 0), Q(1, 1)));
  }
  // With vec() stacking columns, vec(P A) = (A' (x) I) vec(P) and vec(A' P) = (I (x) A') vec(P).
  const Eigen::Matrix2d identity = Eigen::Matrix2d::Identity();
  Eigen::Matrix4d map = Eigen::kroneckerProduct(A.transpose(), identity);
  map += Eigen::kroneckerProduct(identity, A.transpose()).eval();
  const Eigen::Vector4d right_side = -2.0 * Eigen::Map<const Eigen::Vector4d>(Q.data());
  const Eigen::Vector4d solution = map.fullPivLu().solve(right_side);

  const Eigen::Matrix2d P = Eigen::Map<const Eigen::Matrix2d>(solution.data());
  Eigen::Matrix2d symmetric = 0.5 * (P + P.transpose());
  if (!is_positive_definite(symmetric))
    throw std::invalid_argument(
        "the error dynamics A is not stable; give an A with eigenvalues in the left half-plane");
  return symmetric;
}

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
  Q << o.q11, 0.0, 0.0, o.q22;
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
  return {.p11 = P(0, 0), .p12 = P(0, 1), .p22 = P(1, 1), .q11 = o.q11, .q22 = o.q22};
}

paper::Gains<double> paper_gains(const AdaptiveOptions& options) {
  const paper::Weights<double> w = paper_weights(options);
  const AdaptiveOptions& o = options;
  return {.ks0 = o.ks0, .ks1 = o.ks1, .gamma = o.gamma, .ka1 = o.ka1, .p12 = w.p12, .p22 = w.p22};
}

}  // namespace abs_hil::control

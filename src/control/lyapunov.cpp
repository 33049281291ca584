#include "control/lyapunov.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <stdexcept>

#include "rig/formatted_text.hpp"

namespace abs_hil::control {
namespace {

bool is_positive_definite(const Eigen::Matrix2d& M) {
  const Eigen::LLT<Eigen::Matrix2d> cholesky{M};
  return M.allFinite() && cholesky.info() == Eigen::Success;
}

/// Left factor (x) right factor.
Eigen::Matrix4d kronecker(const Eigen::Matrix2d& left, const Eigen::Matrix2d& right) {
  Eigen::Matrix4d product;
  for (Eigen::Index row = 0; row < 2; ++row) {
    for (Eigen::Index column = 0; column < 2; ++column) {
      product.block<2, 2>(2 * row, 2 * column) = left(row, column) * right;
    }
  }
  return product;
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
  const Eigen::Matrix4d map = kronecker(A.transpose(), identity) + kronecker(identity, A.transpose());
  const Eigen::Vector4d right_side = -2.0 * Eigen::Map<const Eigen::Vector4d>(Q.data());
  const Eigen::Vector4d solution = map.fullPivLu().solve(right_side);

  const Eigen::Matrix2d P = Eigen::Map<const Eigen::Matrix2d>(solution.data());
  Eigen::Matrix2d symmetric = 0.5 * (P + P.transpose());
  if (!is_positive_definite(symmetric))
    throw std::invalid_argument(
        "the error dynamics A is not stable; give an A with eigenvalues in the left half-plane");
  return symmetric;
}

}  // namespace abs_hil::control

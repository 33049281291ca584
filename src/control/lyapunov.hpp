// The Lyapunov equation of Theorem 3.1.
#pragma once

#include <Eigen/Core>

namespace abs_hil::control {

/// P of the Lyapunov equation P A + A' P = -2 Q, symmetric and positive definite. Throws std::invalid_argument if Q is
/// not finite, symmetric and positive definite, or if A is not stable (no such P exists then). Not real-time safe.
[[nodiscard]] Eigen::Matrix2d solve_lyapunov(const Eigen::Matrix2d& A, const Eigen::Matrix2d& Q);

}  // namespace abs_hil::control

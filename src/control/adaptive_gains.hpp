// Checks of the adaptive laws' options, and the matrices P and Q of Theorem 3.1 that follow from them.
#pragma once

#include <Eigen/Core>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/paper_laws.hpp"

namespace abs_hil::control {

/// P of the Lyapunov equation P A + A' P = -2 Q, symmetric and positive definite. Throws std::invalid_argument if Q is
/// not finite, symmetric and positive definite, or if A is not stable (no such P exists then). Not real-time safe.
[[nodiscard]] Eigen::Matrix2d solve_lyapunov(const Eigen::Matrix2d& A, const Eigen::Matrix2d& Q);

/// Returns the options unchanged. Throws std::invalid_argument, naming the option, if gamma, ka1 or zeta0 is out of its
/// range or theta_min_N > theta_max_N. Not real-time safe.
[[nodiscard]] const AdaptiveOptions& checked(const AdaptiveOptions& options);

/// P and Q of Theorem 3.1. Throws std::invalid_argument as `paper_gains` does. Not real-time safe.
[[nodiscard]] paper::Weights<double> paper_weights(const AdaptiveOptions& options);

/// The gains of (16)-(18), with B'P of P A + A'P = -2 Q. Throws std::invalid_argument as `checked` does, and if Q is
/// not positive definite or A not stable. Not real-time safe.
[[nodiscard]] paper::Gains<double> paper_gains(const AdaptiveOptions& options);

}  // namespace abs_hil::control

// The gains of (16)-(18) and the matrices P and Q of Theorem 3.1.
#pragma once

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/paper_laws.hpp"

namespace abs_hil::control {

/// Returns the options unchanged. Throws std::invalid_argument, naming the option, if gamma, ka1 or zeta0 is out of its
/// range or theta_min_N > theta_max_N. Not real-time safe.
[[nodiscard]] const AdaptiveOptions& checked(const AdaptiveOptions& options);

/// P and Q of Theorem 3.1. Throws std::invalid_argument as `paper_gains` does. Not real-time safe.
[[nodiscard]] paper::Weights<double> paper_weights(const AdaptiveOptions& options);

/// The gains of (16)-(18), with B'P of P A + A'P = -2 Q. Throws std::invalid_argument as `checked` does, and if Q is
/// not positive definite or A not stable. Not real-time safe.
[[nodiscard]] paper::Gains<double> paper_gains(const AdaptiveOptions& options);

}  // namespace abs_hil::control

#pragma once

#include <Eigen/Core>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// The options themselves, if the adaptation can work with them. Throws std::invalid_argument naming what it cannot
/// work with: gamma, ka1 or zeta0 out of its range, theta_min_N > theta_max_N. Not real-time safe.
[[nodiscard]] const AdaptiveOptions& checked(const AdaptiveOptions& options);

/// B'P of (17): row 2 of P of P A + A'P = -2 Q, since B = [0; 1]. Throws std::invalid_argument if Q is not positive
/// definite or A not stable. Not real-time safe.
[[nodiscard]] Eigen::RowVector2d error_weights(const AdaptiveOptions& options);

}  // namespace abs_hil::control

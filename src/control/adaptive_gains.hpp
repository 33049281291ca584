// Checks of the adaptive laws' options, and the matrices P and Q of Theorem 3.1 that follow from them.
#pragma once

#include <Eigen/Core>
#include <stdexcept>
#include <string>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {

/// P of the Lyapunov equation P A + A' P = -2 Q, symmetric and positive definite. Throws std::invalid_argument if Q is
/// not finite, symmetric and positive definite, or if A is not stable (no such P exists then). Not real-time safe.
[[nodiscard]] Eigen::Matrix2d solve_lyapunov(const Eigen::Matrix2d& A, const Eigen::Matrix2d& Q);

/// Returns the options unchanged. Throws std::invalid_argument, naming the option, if gamma, ka1 or zeta0 is out of its
/// range or theta_min_N > theta_max_N. Not real-time safe.
[[nodiscard]] const AdaptiveOptions& checked(const AdaptiveOptions& options);

/// Returns the options of a law that seeks the slip, unchanged. Throws std::invalid_argument, naming the option, if one
/// is out of its range, or slip_start not in [slip_min, slip_max]. Not real-time safe.
/// @param section  of the keys, with its dot
template <class Options>
[[nodiscard]] const Options& with_sound_slips(const Options& o, const std::string& section) {
  rig::require_valid(o, section);
  if (!(o.slip_min < o.slip_max))
    throw std::invalid_argument(section + "slip_min must be below " + section + "slip_max");
  if (!(o.slip_start >= o.slip_min && o.slip_start <= o.slip_max))
    throw std::invalid_argument(section + "slip_start must be in [slip_min, slip_max]");
  return o;
}

/// P and Q of Theorem 3.1. Throws std::invalid_argument as `paper_gains` does. Not real-time safe.
[[nodiscard]] paper::Weights<double> paper_weights(const AdaptiveOptions& options);

/// The gains of (16)-(18), with B'P of P A + A'P = -2 Q. Throws std::invalid_argument as `checked` does, and if Q is
/// not positive definite or A not stable. Not real-time safe.
[[nodiscard]] paper::Gains<double> paper_gains(const AdaptiveOptions& options);

}  // namespace abs_hil::control

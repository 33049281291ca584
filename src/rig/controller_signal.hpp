#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "abs_hil/rig/signals.hpp"

namespace abs_hil::rig {

/// The outputs of a slip controller, in the order of SlipOutput. The value of the fault `controller_not_finite` is an
/// index into this list, or, from its size on, into the controller's own signals.
inline constexpr std::array<std::string_view, 4> controller_signals{"brake_torque_Nm", "slip_velocity_error_m_s",
                                                                    "theta_est_N", "slip_ref"};

inline constexpr std::size_t controller_output_max = controller_signals.size() + signal_max;

/// Name of the output with this index; empty for another value.
/// @param own  names of the controller's own signals, if known
[[nodiscard]] inline std::string controller_signal(double index, std::span<const std::string> own = {}) {
  for (std::size_t n = 0; n < controller_output_max; ++n) {
    if (index != static_cast<double>(n)) continue;
    if (n < controller_signals.size()) return std::string(controller_signals[n]);
    const std::size_t k = n - controller_signals.size();
    return k < own.size() ? own[k] : "own signal " + std::to_string(k + 1);
  }
  return {};
}

}  // namespace abs_hil::rig

#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>

namespace abs_hil::rig {

/// The outputs of a slip controller, in the order of SlipOutput. The value of the fault `controller_not_finite` is an
/// index into this list.
inline constexpr std::array<std::string_view, 4> controller_signals{"brake_torque_Nm", "slip_velocity_error_m_s",
                                                                    "theta_est_N", "slip_ref"};

/// Name of the signal with this index; empty for another value.
[[nodiscard]] inline std::string_view controller_signal(double index) noexcept {
  for (std::size_t n = 0; n < controller_signals.size(); ++n) {
    if (index == static_cast<double>(n)) return controller_signals[n];
  }
  return {};
}

}  // namespace abs_hil::rig

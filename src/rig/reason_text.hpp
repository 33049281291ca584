#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "abs_hil/rig/reason.hpp"
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

/// A reason in words, with the name of what its value stands for if the value is an index. Not real-time safe.
/// @param own_signals  names of the controller's own signals, if known
[[nodiscard]] inline std::string reason_text(Reason reason, double value,
                                             std::span<const std::string> own_signals = {}) {
  std::string text(description(reason));
  if (reason == Reason::controller_not_finite) text.append(": ").append(controller_signal(value, own_signals));
  return text;
}

/// The same with the value, its unit and its bound behind: "... (speed 203.1 rad/s; bound: gate.overspeed_rad_s)".
/// @param bound_value  the bound's own value as text, if the caller knows it: "200"
[[nodiscard]] inline std::string reason_with_value(Reason reason, double value,
                                                   std::span<const std::string> own_signals = {},
                                                   const std::string& bound_value = {}) {
  std::string text = reason_text(reason, value, own_signals);
  const ReasonValue& facts = row_of(reason).value;
  if (facts.quantity.empty()) return text;
  std::array<char, 32> digits{};
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::general, 6).ptr;
  text.append(" (").append(facts.quantity).append(" ").append(digits.data(), end);
  if (!facts.unit.empty()) text.append(" ").append(facts.unit);
  if (!facts.bound.empty()) text.append("; bound: ").append(facts.bound);
  if (!facts.bound.empty() && !bound_value.empty()) text.append(" = ").append(bound_value);
  return text.append(")");
}

}  // namespace abs_hil::rig

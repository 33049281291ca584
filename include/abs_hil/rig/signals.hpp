#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::rig {

/// Number of signals that a controller may report besides the quantities of each cycle (rig/quantities.hpp).
inline constexpr std::size_t signal_max = 8;

/// A signal of a controller. The text must outlive the controller: use literals.
struct Signal {
  /// With its unit at the end, as in "zeta_N". Letters, digits and '_', a letter first, at most 32 characters, not the
  /// name of a quantity. It is the name of the CSV column and stands in telemetry_t.
  std::string_view name;
  std::string_view meaning;  ///< for people, with the unit in words
};

/// The values of one cycle, in the order of the signals. NaN: not known.
using SignalValues = std::array<double, signal_max>;

inline constexpr SignalValues no_signals = [] {
  SignalValues values{};
  values.fill(std::numeric_limits<double>::quiet_NaN());
  return values;
}();

/// True for a name that `Signal::name` allows.
[[nodiscard]] bool is_signal_name(std::string_view name) noexcept;

/// The signals' names, for files and messages. Throws std::invalid_argument for more than `signal_max` signals, for a
/// name that is not valid, and for one that occurs twice or names a quantity. Not real-time safe.
[[nodiscard]] std::vector<std::string> signal_names(std::span<const Signal> signals);

}  // namespace abs_hil::rig

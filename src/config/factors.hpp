#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "abs_hil/rig/option.hpp"
#include "config/key_table.hpp"

// The table [factors] of experiments and studies: configuration values in which runs differ.

namespace abs_hil::config {

/// A place in a file. Line and column count from 1.
struct Place {
  unsigned int line{0};
  unsigned int column{0};
};

/// Every value is combined with every value of the other factors.
struct Levels {
  std::vector<Value> values{};
};

/// Uniform between its ends, or uniform in the logarithm.
struct Uniform {
  double from{0.0};
  double to{0.0};
  bool logarithmic{false};
};

/// Normal, cut off at its ends.
struct Normal {
  double mean{0.0};
  double sd{0.0};
  double least{0.0};
  double most{0.0};
};

/// A configuration key and the values that it takes.
struct Factor {
  std::string key{};
  std::variant<Levels, Uniform, Normal> values{};
  Place place{};  ///< of the key
  [[nodiscard]] bool has_range() const noexcept { return !std::holds_alternative<Levels>(values); }
};

/// The value at the probability `u` in (0, 1), for a factor with a range. It lies within the range, whatever the
/// rounding. Throws std::bad_variant_access for levels.
[[nodiscard]] double quantile(const Factor& factor, double u);
/// The value of a range at `u` in [0, 1]: its ends at 0 and 1. Real-time safe.
[[nodiscard]] double at(const Uniform& range, double u) noexcept;

/// False for the keys that say who runs a script, and on what: neither settings nor factors of a script may name them.
[[nodiscard]] bool script_may_set(std::string_view key) noexcept;

}  // namespace abs_hil::config

#pragma once

#include <string>
#include <variant>
#include <vector>

#include "config/key_table.hpp"

namespace abs_hil::study {

/// Every value is combined with every value of the other factors.
struct Levels {
  std::vector<config::Value> values{};
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

/// A configuration key and the values that it takes in a study.
struct Factor {
  std::string key{};
  std::variant<Levels, Uniform, Normal> values{};
  [[nodiscard]] bool has_range() const noexcept { return !std::holds_alternative<Levels>(values); }
};

/// The value at the probability `u` in (0, 1), for a factor with a range. It lies within the range, whatever the
/// rounding. Throws std::bad_variant_access for levels.
[[nodiscard]] double quantile(const Factor& factor, double u);

}  // namespace abs_hil::study

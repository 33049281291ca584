#pragma once

#include <charconv>
#include <cmath>
#include <string>

namespace abs_hil::telemetry {

/// A number in a run's CSV: the shortest text that reads back bit-exactly; NaN without a sign.
[[nodiscard]] inline std::string csv_number(double value) {
  if (std::isnan(value)) return "NaN";
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

}  // namespace abs_hil::telemetry

#pragma once

// Texts of CSV: fields of a row, with quotes where they need them.

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "rig/formatted_text.hpp"

namespace abs_hil::telemetry {

/// Appends fields to a row of CSV (RFC 4180).
class CsvRow {
 public:
  void operator()(std::string_view /*name*/, double value) { text(text_of(value)); }
  /// The shortest text that reads back bit-exactly; NaN without a sign, as in a run's CSV.
  [[nodiscard]] static std::string text_of(double value) {
    if (std::isnan(value)) return "NaN";
    char digits[32];
    return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
  }
  template <class Number>
    requires std::is_integral_v<Number>
  void operator()(std::string_view /*name*/, Number value) {
    text(std::to_string(static_cast<std::int64_t>(value)));
  }
  void operator()(std::string_view /*name*/, const std::string& value) { text(value); }
  void text(std::string_view value) {
    if (!std::exchange(first_, false)) row_ += ',';
    row_ += rig::csv_field(value);
  }
  [[nodiscard]] const std::string& row() const noexcept { return row_; }

 private:
  std::string row_;
  bool first_{true};
};

}  // namespace abs_hil::telemetry

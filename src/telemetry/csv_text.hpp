#pragma once

// Texts of CSV: fields of a row, with quotes where they need them.

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

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
    separate();
    if (value.find_first_of(",\"\r\n") == std::string_view::npos) {
      row_ += value;
      return;
    }
    row_ += '"';
    for (const char c : value) {
      if (c == '"') row_ += '"';
      row_ += c;
    }
    row_ += '"';
  }
  [[nodiscard]] const std::string& row() const noexcept { return row_; }

 private:
  void separate() {
    if (!first_) row_ += ',';
    first_ = false;
  }
  std::string row_;
  bool first_{true};
};

}  // namespace abs_hil::telemetry

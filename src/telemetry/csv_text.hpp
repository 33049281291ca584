#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

namespace abs_hil::telemetry {

/// Appends fields to a row of CSV (RFC 4180).
class CsvRow {
 public:
  void operator()(std::string_view /*name*/, double value) {
    // to_chars writes "-nan"; other programs read "NaN" and "-NaN".
    if (std::isnan(value)) return text(std::signbit(value) ? "-NaN" : "NaN");
    number(value);
  }
  template <class Number>
    requires std::is_integral_v<Number>
  void operator()(std::string_view /*name*/, Number value) {
    number(static_cast<std::int64_t>(value));
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
  template <class Number>
  void number(Number value) {
    char digits[32];
    const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
    separate();
    row_.append(digits, end);
  }
  void separate() {
    if (!first_) row_ += ',';
    first_ = false;
  }
  std::string row_;
  bool first_{true};
};

/// Converts hexadecimal digits to bytes. Returns nothing for any other text.
[[nodiscard]] inline std::optional<std::vector<std::uint8_t>> bytes_of_hexadecimal(std::string_view text) {
  std::vector<std::uint8_t> bytes(text.size() / 2);
  if (text.size() % 2 != 0) return std::nullopt;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char* at = text.data() + 2 * i;
    if (const auto [end, error] = std::from_chars(at, at + 2, bytes[i], 16); error != std::errc{} || end != at + 2) {
      return std::nullopt;
    }
  }
  return bytes;
}

/// Reads the whole text as a number of this type. False if it is not one.
template <class Number>
[[nodiscard]] bool parse_number(std::string_view text, Number& value) {
  if constexpr (std::is_floating_point_v<Number>) {
    if (text == "NaN") value = std::numeric_limits<Number>::quiet_NaN();
    if (text == "-NaN") value = -std::numeric_limits<Number>::quiet_NaN();
    if (text == "NaN" || text == "-NaN") return true;
  }
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size();
}

/// Reads rows of CSV. Quoted fields may contain line ends.
class CsvRows {
 public:
  explicit CsvRows(std::FILE* file) : file_(file) {}

  /// False at the end. The fields stay valid until the next call.
  bool next(std::vector<std::string>& fields) {
    fields.clear();
    int c = get();
    if (c == EOF) return false;
    ++row_;
    for (std::string field;; c = get()) {
      if (c == '"' && field.empty()) {
        read_quoted(field);
        continue;
      }
      if (c == ',' || c == '\n' || c == EOF) {
        if (c != ',' && !field.empty() && field.back() == '\r') field.pop_back();
        fields.push_back(std::move(field));
        field.clear();
        if (c != ',') return true;
        continue;
      }
      field += static_cast<char>(c);
    }
  }
  /// Number of the last row that was read. The header is row 1.
  [[nodiscard]] std::uint64_t row() const noexcept { return row_; }

 private:
  int get() { return std::getc(file_); }
  void read_quoted(std::string& field) {
    for (int c = get(); c != EOF; c = get()) {
      if (c == '"') {
        c = get();
        if (c != '"') {
          std::ungetc(c, file_);
          return;
        }
      }
      field += static_cast<char>(c);
    }
  }
  std::FILE* file_;
  std::uint64_t row_{0};
};

}  // namespace abs_hil::telemetry

#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::run_folder {

/// Columns that every run's CSV contains (docs/telemetry.md). Others may follow in any order.
[[nodiscard]] const std::vector<std::string>& contract_columns();

/// The column of the phase's own name, a text.
inline constexpr std::string_view phase_name_column = "phase_name";

/// Reads a run's CSV row by row, with memory that does not grow with the file. Throws InputError with file and line for
/// a file that is no run: missing columns, fields that are not numbers, decreasing time.
class CsvReader {
 public:
  /// Opens the file and reads its header.
  explicit CsvReader(std::filesystem::path path);
  CsvReader(const CsvReader&) = delete;
  CsvReader& operator=(const CsvReader&) = delete;
  ~CsvReader();

  [[nodiscard]] const std::vector<std::string>& columns() const noexcept { return columns_; }
  [[nodiscard]] std::optional<std::size_t> find(std::string_view column) const noexcept;
  /// Like find, but throws InputError if the file does not have the column.
  [[nodiscard]] std::size_t column(std::string_view name) const;

  /// Reads the next row; false at the end. A last line without line end is the trace of a crash: it does not count as a
  /// row, and `truncated` becomes true.
  [[nodiscard]] bool next();

  /// Values of the row: one number per column, NaN for `phase` and `phase_name`.
  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }
  [[nodiscard]] double time_s() const noexcept { return values_[time_column_]; }
  [[nodiscard]] std::string_view phase() const noexcept { return phase_; }
  /// The experiment's own name of the phase; empty in a file of an earlier version.
  [[nodiscard]] std::string_view phase_name() const noexcept { return phase_name_; }
  /// Line number of the row in the file. The header is line 1.
  [[nodiscard]] std::size_t line() const noexcept { return line_; }
  [[nodiscard]] bool truncated() const noexcept { return truncated_; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  [[nodiscard]] bool next_line(std::string_view& line);
  void read_header();
  void read_row(std::string_view line);
  void refill();

  std::filesystem::path path_;
  int file_{-1};
  std::vector<char> buffer_;
  std::size_t begin_{0};
  std::size_t end_{0};
  bool at_end_{false};
  bool truncated_{false};
  std::size_t line_{0};
  std::vector<std::string> columns_;
  std::vector<double> values_;
  std::string phase_;
  std::string phase_name_;
  std::size_t time_column_{0};
  std::size_t phase_column_{0};
  std::optional<std::size_t> phase_name_column_{};
  double last_time_s_;
};

}  // namespace abs_hil::run_folder

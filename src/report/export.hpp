#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

namespace abs_hil::report {

enum class ExportFormat {
  csv,    ///< all runs in one table, with the run's name in the first column
  json,   ///< runs with their summaries, one array per column; null for NaN
  octave  ///< MAT-file, version 5, which Octave, MATLAB and SciPy read: a struct array `runs`
};

struct ExportOptions {
  std::vector<std::filesystem::path> runs{};
  std::vector<std::string> labels{};
  std::vector<std::string> columns{};  ///< empty: the columns that all runs share
  ExportFormat format{ExportFormat::csv};
};

/// Writes the runs' rows. Returns notes about missing or unusual data. Throws InputError.
std::vector<std::string> export_runs(const ExportOptions& options, std::ostream& out);

}  // namespace abs_hil::report

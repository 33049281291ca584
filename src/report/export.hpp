#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <vector>

namespace abs_hil::report {

enum class ExportFormat {
  csv,    ///< all runs below each other, the run's name in front of each row
  json,   ///< runs with their summaries, one array a column; null for NaN
  octave  ///< MAT-file, version 5, which Octave, MATLAB and SciPy read: a struct array `runs`
};

struct ExportOptions {
  std::vector<std::filesystem::path> runs{};
  std::vector<std::string> labels{};
  std::vector<std::string> columns{};  ///< empty: those that all runs have
  ExportFormat format{ExportFormat::csv};
};

/// Writes the runs' rows; returns notes on what is missing or odd. Throws InputError.
std::vector<std::string> export_runs(const ExportOptions& options, std::ostream& out);

}  // namespace abs_hil::report

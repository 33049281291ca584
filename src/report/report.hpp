#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "report/gnuplot.hpp"
#include "report/run_figures.hpp"

namespace abs_hil::report {

struct ReportOptions {
  std::vector<std::filesystem::path> runs{};
  std::vector<std::string> labels{};  ///< empty, or one per run
  std::string title{};                ///< empty: derived from the runs' names
  WindowChoice window{};
  bool paper{false};  ///< make the paper's comparison of two controllers
  std::string version{};
};

/// A finished report.
struct Report {
  std::string html{};
  std::vector<std::string> notes{};  ///< about missing or unusual data
  std::vector<Figure> figures{};
};

/// Reads the runs, draws the figures, lays out the page. Throws InputError, UnavailableError, std::runtime_error.
[[nodiscard]] Report make_report(const ReportOptions& options);

/// Writes the figures as separate files into `folder`, which it creates, and returns their paths. Replaces an existing
/// file only if `replace`. Throws InputError, UnavailableError, std::runtime_error.
std::vector<std::filesystem::path> write_figures(const Report& report, const std::filesystem::path& folder,
                                                 PictureFormat format, bool replace);

/// Throws InputError if `path` exists and is not a page of abs_report, unless `replace`.
void check_replaceable(const std::filesystem::path& path, bool replace);

}  // namespace abs_hil::report

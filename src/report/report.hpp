#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "report/gnuplot.hpp"
#include "report/run_figures.hpp"

namespace abs_hil::report {

struct ReportOptions {
  std::vector<std::filesystem::path> runs{};
  std::vector<std::string> labels{};  ///< none, or one for each run
  std::string title{};                ///< empty: made from the runs' names
  WindowChoice window{};
  bool paper{false};  ///< the paper's comparison of two controllers
  std::string version{};
};

/// A finished report.
struct Report {
  std::string html{};
  std::vector<std::string> notes{};  ///< what is missing or odd, in words
  std::vector<Figure> figures{};
};

/// Reads the runs, draws the figures, lays out the page. Throws InputError, UnavailableError, std::runtime_error.
[[nodiscard]] Report make_report(const ReportOptions& options);

/// Writes the figures as files of their own into `folder`, which is created; returns their paths. A file of that name
/// that is there already is replaced only if `replace`. Throws InputError, UnavailableError, std::runtime_error.
std::vector<std::filesystem::path> write_figures(const Report& report, const std::filesystem::path& folder,
                                                 PictureFormat format, bool replace);

/// Throws InputError if something stands at `path` that is no report of ours, unless `replace`.
void check_replaceable(const std::filesystem::path& path, bool replace);

}  // namespace abs_hil::report

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "analysis/result_file.hpp"
#include "cli/command_line.hpp"
#include "report/export.hpp"
#include "report/input_error.hpp"
#include "report/report.hpp"

namespace {

using namespace abs_hil;

enum ExitStatus { done = 0, bad_input = 2, unavailable = 3 };

struct Options {
  report::ReportOptions report{};
  std::vector<std::string> runs{};
  std::string output{};
  bool force{false};
  std::string window{"brake"};
  std::string figures{};
  int format{static_cast<int>(report::PictureFormat::svg)};  ///< a report::PictureFormat
  bool csv{false};
  bool json{false};
  bool octave{false};
  std::vector<std::string> columns{};

  /// The format in which to export rows; none: a page is wanted.
  [[nodiscard]] std::optional<report::ExportFormat> export_as() const {
    if (csv) return report::ExportFormat::csv;
    if (json) return report::ExportFormat::json;
    if (octave) return report::ExportFormat::octave;
    return std::nullopt;
  }
};

/// Formats of figures by their names, which are those of their files.
std::vector<std::pair<std::string, int>> picture_formats() {
  std::vector<std::pair<std::string, int>> formats;
  for (const auto format : {report::PictureFormat::pdf, report::PictureFormat::png, report::PictureFormat::svg}) {
    formats.emplace_back(report::extension_of(format), static_cast<int>(format));
  }
  return formats;
}

void say(const std::vector<std::string>& notes) {
  constexpr std::size_t most = 10;
  for (std::size_t i = 0; i < notes.size() && i < most; ++i) fmt::print(stderr, "abs_report: note: {}\n", notes[i]);
  if (notes.size() > most) fmt::print(stderr, "abs_report: note: and {} more\n", notes.size() - most);
}

report::WindowChoice parse_window(const std::string& text) {
  using Kind = report::WindowChoice::Kind;
  if (text == "brake") return {Kind::brake, {}};
  if (text == "run") return {Kind::run, {}};
  report::WindowChoice choice{Kind::given, {}};
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf:%lf%n", &choice.range.first, &choice.range.second, &used) == 2 &&
      static_cast<std::size_t>(used) == text.size() && choice.range.first < choice.range.second) {
    return choice;
  }
  throw report::InputError("--window " + text + ": give brake, run, or FROM:TO in seconds with FROM < TO");
}

int export_rows(const Options& o, report::ExportFormat format) {
  const report::ExportOptions options{o.report.runs, o.report.labels, o.columns, format};
  const bool binary = format == report::ExportFormat::octave;
  if (o.output.empty()) {
    if (binary && ::isatty(STDOUT_FILENO) != 0) {
      throw report::InputError("--octave writes a binary file: give --output RUN.mat or redirect stdout");
    }
    say(report::export_runs(options, std::cout));
    std::cout.flush();
    if (!std::cout) throw std::runtime_error("cannot write to the standard output");
    return done;
  }
  std::error_code ignored;
  if (!o.force && std::filesystem::exists(o.output, ignored)) {
    throw report::InputError("\"" + o.output + "\" exists; give another --output, or --force to replace it");
  }
  std::ofstream file(o.output, std::ios::binary);
  if (!file) {
    throw report::InputError("cannot write \"" + o.output + "\"; give a path in an existing, writable directory");
  }
  say(report::export_runs(options, file));
  file.close();
  if (!file) throw std::runtime_error("cannot write \"" + o.output + "\"");
  return done;
}

int write_report(Options& o) {
  const std::string path = o.output.empty() ? "report.html" : o.output;
  report::check_replaceable(path, o.force);
  o.report.window = parse_window(o.window);
  const report::Report made = report::make_report(o.report);
  analysis::ResultFile(path, "the report").write(made.html);
  say(made.notes);
  fmt::print("{}\n", path);
  if (!o.figures.empty()) {
    for (const auto& figure :
         report::write_figures(made, o.figures, static_cast<report::PictureFormat>(o.format), o.force)) {
      fmt::print("{}\n", figure.string());
    }
  }
  return done;
}

void add_options(cli::Parser& parser, Options& o) {
  parser.add(
      {.names = "RUN", .to = &o.runs, .help = "run folders, series folders, or CSV files of runs", .required = true});
  parser.add({.names = "--output",
              .to = &o.output,
              .help = "file of the page (default: report.html) or of the exported rows (default: stdout)"});
  parser.add({.names = "--force", .to = &o.force, .help = "replace existing files"});
  parser.add({.names = "--title", .to = &o.report.title, .help = "heading of the page"});
  parser.add(
      {.names = "--label", .to = &o.report.labels, .help = "name of each run in legends and tables, one per run"});
  parser.add({.names = "--window",
              .to = &o.window,
              .help = "time range of the figures: brake, run, or FROM:TO in seconds of the run",
              .show_default = true});
  parser.add({.names = "--paper",
              .to = &o.report.paper,
              .help = "make the paper's comparison page from an adaptive and a sliding-mode run"});
  parser.add({.names = "--figures", .to = &o.figures, .help = "folder for the figures as separate files"});
  parser.add({.names = "--format",
              .to = &o.format,
              .help = "format of these files: svg, png or pdf",
              .type = "ENUM",
              .words = picture_formats(),
              .needs = {"--figures"}});
  cli::Parser formats =
      parser.add_group("export", "export rows instead of a page, to --output or stdout", {.least = 0, .most = 1});
  formats.add({.names = "--csv", .to = &o.csv, .help = "all runs in one CSV, with the run's name in the first column"});
  formats.add({.names = "--json", .to = &o.json, .help = "runs with summaries, one array per column"});
  formats.add({.names = "--octave", .to = &o.octave, .help = "MAT-file for Octave, MATLAB, SciPy"});
  parser.add({.names = "--columns",
              .to = &o.columns,
              .help = "columns to export, separated by commas (default: all)",
              .delimiter = ',',
              .repeated = true});
}

int run(int argc, char** argv) {
  cli::Parser parser("abs_report", "Turns runs into a page with figures and tables, or exports their rows");
  parser.set_version(ABS_HIL_VERSION);
  Options o;
  o.report.version = ABS_HIL_VERSION;
  add_options(parser, o);
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  o.report.runs.assign(o.runs.begin(), o.runs.end());
  const std::optional<report::ExportFormat> export_as = o.export_as();
  if (!export_as && !o.columns.empty()) {
    throw report::InputError("--columns selects columns to export: also give --csv, --json or --octave");
  }
  if (export_as && (o.report.paper || !o.figures.empty())) {
    throw report::InputError(
        "--paper and --figures make a page; --csv, --json and --octave export rows; give one kind only");
  }
  return export_as ? export_rows(o, *export_as) : write_report(o);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const report::UnavailableError& error) {
    fmt::print(stderr, "abs_report: {}\n", error.what());
    return unavailable;
  } catch (const std::exception& error) {
    fmt::print(stderr, "abs_report: {}\n", error.what());
    return bad_input;
  }
}

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "analysis/result_file.hpp"
#include "report/export.hpp"
#include "report/input_error.hpp"
#include "report/report.hpp"

namespace {

using namespace abs_hil;

enum ExitStatus { done = 0, bad_input = 2, unavailable = 3 };

struct Options {
  report::ReportOptions report{};
  std::string output{};
  bool force{false};
  std::string window{"brake"};
  std::string figures{};
  report::PictureFormat format{report::PictureFormat::svg};
  std::optional<report::ExportFormat> export_as{};
  std::vector<std::string> columns{};
};

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
    for (const auto& figure : report::write_figures(made, o.figures, o.format, o.force)) {
      fmt::print("{}\n", figure.string());
    }
  }
  return done;
}

void add_options(CLI::App& cli, Options& o) {
  cli.add_option("RUN", o.report.runs, "run folders, series folders, or CSV files of runs")->required();
  cli.add_option("--output", o.output,
                 "file of the page (default: report.html) or of the exported rows (default: stdout)");
  cli.add_flag("--force", o.force, "replace existing files");
  cli.add_option("--title", o.report.title, "heading of the page");
  cli.add_option("--label", o.report.labels, "name of each run in legends and tables, one per run")->take_all();
  cli.add_option("--window", o.window, "time range of the figures: brake, run, or FROM:TO in seconds of the run")
      ->capture_default_str();
  cli.add_flag("--paper", o.report.paper, "make the paper's comparison page from an adaptive and a sliding-mode run");
  cli.add_option("--figures", o.figures, "folder for the figures as separate files");
  cli.add_option("--format", o.format, "format of these files: svg, png or pdf")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, report::PictureFormat>{{"svg", report::PictureFormat::svg},
                                                                               {"png", report::PictureFormat::png},
                                                                               {"pdf", report::PictureFormat::pdf}}))
      ->needs("--figures");
  auto* formats = cli.add_option_group("export", "export rows instead of a page, to --output or stdout");
  const auto add_export = [&](const char* name, report::ExportFormat format, const char* help) {
    formats->add_flag_callback(
        name, [&o, format] { o.export_as = format; }, help);
  };
  add_export("--csv", report::ExportFormat::csv, "all runs in one CSV, with the run's name in the first column");
  add_export("--json", report::ExportFormat::json, "runs with summaries, one array per column");
  add_export("--octave", report::ExportFormat::octave, "MAT-file for Octave, MATLAB, SciPy");
  formats->require_option(0, 1);
  cli.add_option("--columns", o.columns, "columns to export, separated by commas (default: all)")
      ->allow_extra_args(false)
      ->delimiter(',');
}

int run(int argc, char** argv) {
  CLI::App cli{"Turns runs into a page with figures and tables, or exports their rows"};
  cli.name("abs_report");
  cli.set_version_flag("--version", ABS_HIL_VERSION);
  Options o;
  o.report.version = ABS_HIL_VERSION;
  add_options(cli, o);
  try {
    cli.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return cli.exit(error);  // --help, --version
    fmt::print(stderr, "abs_report: {} (abs_report --help shows all options)\n", error.what());
    return bad_input;
  }
  if (!o.export_as && !o.columns.empty()) {
    throw report::InputError("--columns selects columns to export: also give --csv, --json or --octave");
  }
  if (o.export_as && (o.report.paper || !o.figures.empty())) {
    throw report::InputError(
        "--paper and --figures make a page; --csv, --json and --octave export rows; give one kind only");
  }
  return o.export_as ? export_rows(o, *o.export_as) : write_report(o);
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

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <memory>

#include "analysis/result_file.hpp"
#include "config/config_error.hpp"
#include "program/exit_status.hpp"
#include "program/subcommands.hpp"
#include "study/comparison_table.hpp"
#include "study/parallel.hpp"

namespace abs_hil::program {

namespace {

/// The paper brakes from 1625 rpm, 170 rad/s.
constexpr double default_start_speed_rad_s = 170.0;

/// Opens a result file. Called before the runs, so that a bad path is reported at once.
std::unique_ptr<analysis::ResultFile> open(const std::optional<std::string>& path) try {
  return path ? std::make_unique<analysis::ResultFile>(*path, "the comparison") : nullptr;
} catch (const std::runtime_error& error) {
  throw config::ConfigError(error.what());
}

/// Refuses a file name that is a number: --repeat was meant.
void refuse_number(const std::optional<std::string>& file) {
  if (!file || file->empty() || file->find_first_not_of("0123456789") != std::string::npos) return;
  throw config::ConfigError(
      fmt::format("--runs {0}: this names the file for the single runs; for {0} runs of each controller give --repeat "
                  "{0}, for a file of this name --runs ./{0}",
                  *file));
}

/// Prints the progress in steps of one hundredth if stderr is a terminal.
std::function<void(std::size_t)> progress(std::size_t runs) {
  if (isatty(STDERR_FILENO) == 0) return {};
  const std::size_t step = std::max<std::size_t>(1, runs / 100);
  return [runs, step](std::size_t done) {
    if (done % step == 0) fmt::print(stderr, "\r{} of {} runs", done, runs);
    if (done == runs) fmt::print(stderr, "\r\033[K");
  };
}

}  // namespace

int compare(const CompareOptions& options) {
  refuse_number(options.runs_file);
  RunOptions run = options.run;
  run.defaults.push_back(fmt::format("experiment.start_speed_rad_s={}", default_start_speed_rad_s));
  const RunRequest request = merge(run);
  const study::ComparisonPlan plan{
      .settings = request.settings,
      .controllers = study::split_contenders(options.controllers),
      .repeat = options.repeat,
      .seed = options.seed,
      .variation = options.vary ? study::Variation::parse(*options.vary) : study::Variation::standard(),
      .threads = options.threads > 0 ? options.threads : study::machine_threads()};
  auto json = open(options.json_file);
  auto csv = open(options.csv_file);
  auto markdown = open(options.markdown_file);
  auto runs = open(options.runs_file);

  const study::Comparison results = study::compare(plan, progress(plan.repeat * plan.controllers.size()));
  const study::ComparisonTable table = study::tabulate(plan, results);
  if (json) json->write(study::to_json(table, request.config_json));
  if (csv) csv->write(study::to_csv(table));
  if (markdown) markdown->write(study::to_markdown(table));
  if (runs) runs->write(study::runs_csv(plan, results));
  fmt::print("{}", study::to_text(table));
  return exit_completed;
}

}  // namespace abs_hil::program

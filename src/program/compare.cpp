#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <memory>

#include "config/config_error.hpp"
#include "files/result_file.hpp"
#include "program/exit_status.hpp"
#include "program/run_progress.hpp"
#include "program/study_runs.hpp"
#include "program/subcommands.hpp"
#include "study/comparison_table.hpp"
#include "study/parallel.hpp"

namespace abs_hil::program {

namespace {

/// A controller's heading as the name of a folder.
std::string folder_name(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return std::isalnum(c) == 0 && c != '-' && c != '_' && c != '.' && c != '='; }, '_');
  return name;
}

/// Opens a result file. Called before the runs, so that a bad path is reported at once.
std::unique_ptr<files::ResultFile> open(const std::optional<std::string>& path) try {
  return path ? std::make_unique<files::ResultFile>(*path, "comparison") : nullptr;
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

/// Repeats one run of each controller with everything recorded, each in a folder of its own if there are several.
int record(const CompareOptions& options, const study::Study& study, const RunOptions& run,
           const std::vector<std::string>& command_line) {
  const std::size_t kinds = study.contenders(0).size();
  const auto first = static_cast<std::uint64_t>(*options.recorded_run) * kinds;
  if (first >= study.runs()) {
    throw config::ConfigError(
        fmt::format("--run {}: each controller has {} runs; give a number in [0, {}], or a larger "
                    "--repeat",
                    *options.recorded_run, options.repeat, options.repeat - 1));
  }
  int status = exit_completed;
  for (std::size_t c = 0; c < kinds; ++c) {
    std::optional<std::string> folder = options.run_folder;
    if (folder && kinds > 1) *folder += '/' + folder_name(study.contenders(0)[c].name);
    status = std::max(status, record_run(study, first + c, run, folder, command_line));
  }
  return status;
}

}  // namespace

int compare(const CompareOptions& options, const std::vector<std::string>& command_line) {
  refuse_number(options.runs_file);
  RunOptions run = options.run;
  run.defaults.push_back(fmt::format("experiment.start_speed_rad_s={}", study_start_speed_rad_s));
  const RunRequest request = merge(run);
  const study::ComparisonPlan plan{
      .settings = request.settings,
      .controllers = study::split_contenders(options.controllers),
      .repeat = options.repeat,
      .seed = options.seed,
      .variation = options.vary ? study::Variation::parse(*options.vary) : study::Variation::standard(),
      .threads = options.threads > 0 ? options.threads : study::machine_threads()};
  if (options.recorded_run) return record(options, study::study_of(plan), run, command_line);
  auto json = open(options.json_file);
  auto csv = open(options.csv_file);
  auto markdown = open(options.markdown_file);
  auto runs = open(options.runs_file);

  const study::Comparison results = [&] {
    RunProgress progress(plan.repeat * plan.controllers.size());
    return study::compare(plan, [&progress](std::size_t done) { progress.show(done); });
  }();
  const study::ComparisonTable table = study::tabulate(plan, results);
  if (json) json->write(study::to_json(table, request.config_json));
  if (csv) csv->write(study::to_csv(table));
  if (markdown) markdown->write(study::to_markdown(table));
  if (runs) runs->write(study::runs_csv(plan, results));
  fmt::print("{}", study::to_text(table));
  return exit_completed;
}

}  // namespace abs_hil::program

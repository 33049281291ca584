// `abs_hil compare`: a study of one case, whose runs are put side by side.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <set>

#include "config/config_error.hpp"
#include "interchange/foreign_controller.hpp"
#include "program/command_line.hpp"
#include "program/signals.hpp"
#include "program/study_command.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"
#include "run_folder/run_folder.hpp"
#include "study/comparison.hpp"
#include "study/parallel.hpp"

namespace abs_hil::program {

namespace {

/// The options of `abs_hil compare` as typed.
struct CompareOptions {
  config::Sources sources{};  ///< only plant, model, configuration file and assignments are used
  std::string controllers{"adaptive,sliding-mode"};
  std::size_t repeat{100};
  std::uint64_t seed{1};
  std::optional<std::string> vary{};
  std::size_t threads{0};          ///< 0: one for each processor
  std::vector<std::string> out{};  ///< files of the table; with --run its folder
  std::optional<std::string> runs_file{};
  std::optional<int> recorded_run{};  ///< --run: repeat this run of each controller in place of the comparison
};

/// Refuses a file name that is a number: --repeat was meant.
void refuse_number(const std::optional<std::string>& file) {
  if (!file || file->empty() || file->find_first_not_of("0123456789") != std::string::npos) return;
  throw config::ConfigError(
      fmt::format("--runs {0}: this names the file for the single runs; for {0} runs of each controller give --repeat "
                  "{0}, for a file of this name --runs ./{0}",
                  *file));
}

/// Repeats one run of each controller with everything recorded, each in a folder of its own if there are several.
int record(const CompareOptions& options, const study::Study& study, const std::vector<std::string>& command_line) {
  const auto repetition = static_cast<std::uint64_t>(*options.recorded_run);
  const std::vector<study::Contender>& contenders = study.contenders(0);
  if (repetition >= options.repeat) {
    throw config::ConfigError(
        fmt::format("--run {}: each controller has {} runs; give a number in [0, {}], or a larger --repeat", repetition,
                    options.repeat, options.repeat - 1));
  }
  if (options.out.size() > 1) throw config::ConfigError("--out: with --run give one, a folder: nothing is compared");
  int status = exit_completed;
  std::set<std::string> names;
  for (std::size_t c = 0; c < contenders.size(); ++c) {
    std::optional<std::string> folder;
    if (!options.out.empty()) folder = options.out.front();
    if (folder && contenders.size() > 1) {
      constexpr std::size_t number_bytes = 12;
      std::string name = run_folder::folder_name(contenders[c].name, *folder, number_bytes);
      while (!names.insert(name).second) name += fmt::format("-{}", c + 1);
      *folder += '/' + name;
    }
    status = std::max(status, record_run(study, repetition * contenders.size() + c, folder, command_line));
  }
  return status;
}

int compare_controllers(const CompareOptions& options, const std::vector<std::string>& command_line) {
  refuse_number(options.runs_file);
  config::Sources sources = options.sources;
  sources.defaults.emplace_back(study::start_speed_default);
  keep_inputs(sources);
  const config::Configuration merged = config::merge(sources);
  const config::Settings& s = merged.settings;
  interchange::accept_unprotected_files(s.unsafe.foreign_files);
  const study::Study study(
      {.controllers = study::split_contenders(options.controllers),
       .repeat = {.runs = options.repeat,
                  .seed = options.seed,
                  .variation = options.vary ? study::Variation::parse(*options.vary) : study::Variation::standard()},
       .path = "compare"},
      {{.plant = s.plant_name, .experiment = s.experiment.name, .settings = s}});
  if (options.recorded_run) return record(options, study, command_line);
  std::vector<std::unique_ptr<files::ResultFile>> tables;
  for (const std::string& file : options.out) tables.push_back(open_result(file, "comparison"));
  const auto runs_file = open_result(options.runs_file, "comparison");

  study::RunsByController runs;
  try {
    RunProgress progress;
    const std::size_t threads = options.threads > 0 ? options.threads : study::machine_threads();
    runs = study::run_by_controller(study, threads, [&](std::size_t done) { progress.show(done, study.runs()); });
  } catch (const Interrupted& interrupted) {
    spdlog::warn(
        "interrupted after {} of {} runs. A comparison keeps nothing: repeat it, with fewer --repeat if it takes too "
        "long; `abs_hil study` can go on after an interruption (docs/studies.md)",
        interrupted.done, study.runs());
    return status_of(signalled());
  }
  const study::ComparisonTable table = study::tabulate(study, runs);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    const std::string& file = options.out[i];
    tables[i]->write(file.ends_with(".json")  ? study::to_json(table, merged.json)
                     : file.ends_with(".csv") ? study::to_csv(table)
                                              : study::to_markdown(table));
  }
  if (runs_file) runs_file->write(study::runs_csv(study, runs));
  cli::print("{}", study::to_text(table));
  return exit_completed;
}

}  // namespace

Action add_compare(cli::Parser& compare, const Words& words) {
  const auto options = std::make_shared<CompareOptions>();
  CompareOptions& o = *options;
  compare.add("--plant", &o.sources.plant, "plant by name or TOML file", {.type = "NAME|FILE"});
  compare.add("--model", &o.sources.model, "every controller's model (default: the plant, before it varies)",
              {.type = "NAME|FILE"});
  compare.add("--controllers,--controller", &o.controllers,
              "controllers, the first one the baseline: NAME, NAME{key=value,...}, a TOML file, each with "
              "LABEL= before it if you like; or all",
              {.type = "A,B,...", .show_default = true});
  compare.add("--repeat", &o.repeat, "runs of each controller",
              {.type = "N", .range = {1, 1'000'000}, .show_default = true});
  compare.add("--seed", &o.seed, "seed of the varied plants", {.type = "N", .show_default = true});
  compare.add("--vary", &o.vary, "what varies: parameters (wheels, brake, tyre), theta, radii, phase, or none",
              {.type = "SPEC", .default_text = "parameters=0.1,theta=0.1,phase"});
  add_config_file(compare, o.sources);
  add_assignments(compare, o.sources);
  add_threads(compare, o.threads);
  compare.add("--out,--json,--csv,--markdown", &o.out,
              "the table as FILE.csv, FILE.json or FILE.md, or several; with --run its run folder, or one below it for "
              "each controller",
              {.type = "FILE.csv|FILE.json|FILE.md|DIR", .repeated = true});
  compare.add("--runs", &o.runs_file, "write each run's results as CSV", {.type = "FILE.csv"});
  compare.add("--run", &o.recorded_run,
              "repeat run K of each controller (see --runs) with everything recorded, and compare nothing",
              {.type = "K", .range = {0, 999'999}, .excludes = {"--runs"}});
  compare.set_footer("To compare runs that are already recorded, use abs_report RUN RUN.");
  return [options, words] { return compare_controllers(*options, words); };
}

}  // namespace abs_hil::program

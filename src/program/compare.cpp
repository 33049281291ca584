// `abs_hil compare`: a study of one case, whose runs are put side by side.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <memory>
#include <set>

#include "config/config_error.hpp"
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
  std::size_t threads{0};                                   ///< 0: one for each processor
  std::optional<std::string> out{};                         ///< file of the table; with --run its folder
  std::array<std::optional<std::string>, 3> table_files{};  ///< in the order of `formats`
  std::optional<std::string> runs_file{};
  std::optional<int> recorded_run{};  ///< --run: repeat this run of each controller in place of the comparison
};

/// Of the table as a file.
struct Format {
  std::string_view option;
  std::string_view type;
  std::string (*text)(const study::ComparisonTable& table, const std::string& config_json);
};
constexpr std::array<Format, 3> formats{
    {{"--json", "FILE.json", &study::to_json},
     {"--csv", "FILE.csv",
      [](const study::ComparisonTable& table, const std::string&) { return study::to_csv(table); }},
     {"--markdown", "FILE.md",
      [](const study::ComparisonTable& table, const std::string&) { return study::to_markdown(table); }}}};

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
  int status = exit_completed;
  std::set<std::string> names;
  for (std::size_t c = 0; c < contenders.size(); ++c) {
    std::optional<std::string> folder = options.out;
    if (folder && contenders.size() > 1) {
      constexpr std::size_t number_bytes = 12;
      std::string name = run_folder::folder_name(contenders[c].name, *folder, number_bytes, '_');
      while (!names.insert(name).second) name += fmt::format("-{}", c + 1);
      *folder += '/' + name;
    }
    status = std::max(status, record_run(study, repetition * contenders.size() + c, folder, command_line));
  }
  return status;
}

int compare_controllers(CompareOptions options, const std::vector<std::string>& command_line) {
  if (options.out && !options.recorded_run) {
    const auto ending = [](const Format& format) { return format.type.substr(std::string_view("FILE").size()); };
    const auto format =
        std::ranges::find_if(formats, [&](const Format& f) { return options.out->ends_with(ending(f)); });
    if (format == formats.end()) {
      throw config::ConfigError("--out " + *options.out +
                                ": give FILE.json, FILE.csv or FILE.md for the table; a folder "
                                "goes with --run K");
    }
    options.table_files[static_cast<std::size_t>(format - formats.begin())] = options.out;
  }
  refuse_number(options.runs_file);
  config::Sources sources = options.sources;
  sources.defaults.emplace_back(study::start_speed_default);
  keep_inputs(sources);
  const config::Configuration merged = config::merge(sources);
  const config::Settings& s = merged.settings;
  const study::Study study(
      {.controllers = study::split_contenders(options.controllers),
       .repeat = {.runs = options.repeat,
                  .seed = options.seed,
                  .variation = options.vary ? study::Variation::parse(*options.vary) : study::Variation::standard()},
       .path = "compare"},
      {{.plant = s.plant_name, .experiment = s.experiment.name, .settings = s}});
  if (options.recorded_run) return record(options, study, command_line);
  std::vector<std::unique_ptr<files::ResultFile>> tables;
  for (const auto& file : options.table_files) tables.push_back(open_result(file, "comparison"));
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
    if (tables[i]) tables[i]->write(formats[i].text(table, merged.json));
  }
  if (runs_file) runs_file->write(study::runs_csv(study, runs));
  cli::print(files::for_people(), "{}", study::to_text(table));
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
  for (std::size_t i = 0; i < formats.size(); ++i) {
    compare.add(std::string(formats[i].option), &o.table_files[i], "write the table in this format",
                {.type = std::string(formats[i].type)});
  }
  compare.add(
      "--out", &o.out,
      "write the table in the format of its ending; with --run its run folder, or one below it for each controller",
      {.type = "FILE.json|FILE.csv|FILE.md|DIR", .excludes = {"--json", "--csv", "--markdown"}});
  compare.add("--runs", &o.runs_file, "write each run's results as CSV", {.type = "FILE.csv"});
  compare.add("--run", &o.recorded_run,
              "repeat run K of each controller (see --runs) with everything recorded, and compare nothing",
              {.type = "K", .range = {0, 999'999}, .excludes = {"--json", "--csv", "--markdown", "--runs"}});
  compare.set_footer("To compare runs that are already recorded, use abs_report RUN RUN.");
  return [options, words] { return compare_controllers(*options, words); };
}

}  // namespace abs_hil::program

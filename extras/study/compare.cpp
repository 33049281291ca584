// `abs_hil compare`: a study of one case. The tables of its rows are made by abs_compare_tables, in Python
// (abs_hil/compare.py).
#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "abs_hil/driver/io_result.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "config/merge.hpp"
#include "driver/spawn.hpp"
#include "program/subcommands.hpp"
#include "run/parallel.hpp"
#include "run_folder/run_folder.hpp"
#include "study/compute.hpp"
#include "study/study_command.hpp"

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
  std::string_view option;  ///< behind its "--" the name of the text in the answer of abs_compare_tables
  std::string_view type;
};
constexpr std::array<Format, 3> formats{{{"--json", "FILE.json"}, {"--csv", "FILE.csv"}, {"--markdown", "FILE.md"}}};

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
      std::string name = run_folder::folder_name(contenders[c].name, *folder, number_bytes);
      while (!names.insert(name).second) name += fmt::format("-{}", c + 1);
      *folder += '/' + name;
    }
    status = std::max(status, record_run(study, repetition * contenders.size() + c, folder, command_line));
  }
  return status;
}

/// What the rows do not say of the comparison.
nlohmann::ordered_json facts_of(const study::Study& study, const config::Configuration& merged) {
  const study::RepeatScript& repeat = study.script().repeat;
  auto controllers = nlohmann::ordered_json::array();
  for (const study::Contender& contender : study.contenders(0)) {
    controllers.push_back({{"name", contender.name},
                           {"controller", contender.settings.control.controller},
                           {"settings", contender.changes}});
  }
  return {{"repeat", repeat.runs},
          {"seed", repeat.seed},
          {"vary", repeat.variation.text()},
          {"controllers", controllers},
          {"model_differs", config::in_words(config::model_differences(merged.settings))},
          {"config", nlohmann::ordered_json::parse(merged.json)}};
}

/// The plants that were drawn: the numbers that vary, by their keys, and the simulator's seed. Fields of a row.
class DrawnPlants {
 public:
  explicit DrawnPlants(const study::Study& study)
      : study_(study), runs_(study), settings_(study.cases().front().settings), keys_(settings_) {
    const plant_sim::PlantOptions nominal = settings_.plant;
    const plant_sim::PlantOptions least = perturbed(nominal, smallest(study.script().repeat.variation));
    for (const config::Key& key : keys_.keys()) {
      const auto* const* number = std::get_if<double*>(&key.target);
      if (number == nullptr || !key.name.starts_with("plant.")) continue;
      settings_.plant = nominal;
      const double value = **number;
      settings_.plant = least;
      if (**number == value) continue;
      numbers_.push_back(*number);
      names_ += ',' + key.name;
    }
  }
  [[nodiscard]] std::string names() const { return names_ + ",sensor_seed"; }
  std::string values(std::uint64_t run) {
    study::RunSettings::Drawn drawn = runs_.drawn(study_.index_of(run));
    settings_.plant = std::move(drawn.plant);
    std::string text;
    for (const double* number : numbers_) text += fmt::format(",{}", *number);
    return text + fmt::format(",{}", drawn.seed);
  }

 private:
  const study::Study& study_;
  study::RunSettings runs_;
  config::Settings settings_;
  config::KeyTable keys_;
  std::vector<const double*> numbers_{};
  std::string names_{};
};

/// abs_compare_tables. It loads its packages while the runs are computed, and says itself why it ends early.
class TableMaker {
 public:
  TableMaker() {
    std::array<int, 2> in{-1, -1};
    std::array<int, 2> out{-1, -1};
    const bool piped = ::pipe2(in.data(), O_CLOEXEC) == 0 && ::pipe2(out.data(), O_CLOEXEC) == 0;
    const std::string program = python_program("compare_tables");
    const int error = piped ? driver::spawn(pid_, program, {{in[0], STDIN_FILENO}, {out[1], STDOUT_FILENO}}) : errno;
    ::close(in[0]);
    ::close(out[1]);
    to_ = ::fdopen(in[1], "w");
    from_ = ::fdopen(out[0], "r");
    if (error != 0) throw driver::Unavailable(no_python_program("compare_tables", error));
  }
  /// False if it has ended. Thread-safe.
  [[nodiscard]] bool listens() const noexcept {
    pollfd reader{.fd = ::fileno(to_), .events = 0, .revents = 0};
    return ::poll(&reader, 1, 0) == 0;
  }
  void tell(const std::string& text) { std::fwrite(text.data(), 1, text.size(), to_); }
  /// What it makes of all that it was told.
  std::string answer() {
    std::fclose(to_);
    std::string text;
    std::array<char, 65'536> block{};
    while (const std::size_t read = std::fread(block.data(), 1, block.size(), from_)) text.append(block.data(), read);
    return text;
  }
  /// Its exit status.
  [[nodiscard]] int end() const {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    throw std::runtime_error(
        fmt::format("abs_compare_tables was ended by signal {}; repeat the comparison", WTERMSIG(status)));
  }

 private:
  pid_t pid_{-1};
  std::FILE* to_{nullptr};
  std::FILE* from_{nullptr};
};

std::vector<study::Outcome> outcomes_of(const study::Study& study, std::size_t threads, const TableMaker& tables) {
  std::vector<study::Outcome> outcomes(study.runs());
  std::atomic<std::size_t> finished{0};
  RunProgress progress;
  run_part(
      study, study.runs(), threads > 0 ? threads : run::machine_threads(), [](std::size_t index) { return index; },
      [&](std::size_t index, study::Outcome outcome) {
        if (!outcome.refusal.empty()) throw std::invalid_argument(outcome.refusal);
        outcomes[index] = std::move(outcome);
        const std::size_t done = ++finished;
        if (!tables.listens()) throw Interrupted{done};
        progress.show(done, study.runs());
      });
  return outcomes;
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
  std::vector<std::pair<std::string, std::unique_ptr<files::ResultFile>>> results;
  for (std::size_t i = 0; i < formats.size(); ++i) {
    if (options.table_files[i]) {
      results.emplace_back(formats[i].option.substr(2), open_result(options.table_files[i], "comparison"));
    }
  }
  if (options.runs_file) results.emplace_back("runs", open_result(options.runs_file, "comparison"));
  TableMaker tables;
  std::vector<study::Outcome> outcomes;
  try {
    outcomes = outcomes_of(study, options.threads, tables);
  } catch (const Interrupted& interrupted) {
    if (signalled() == rig::Reason::none) return tables.end();
    spdlog::warn(
        "interrupted after {} of {} runs. A comparison keeps nothing: repeat it, with fewer --repeat if it takes too "
        "long; `abs_hil study` can go on after an interruption (docs/studies.md)",
        interrupted.done, study.runs());
    return status_of(signalled());
  }
  DrawnPlants plants(study);
  tables.tell(facts_of(study, merged).dump() + '\n');
  tables.tell(fmt::format("{}{}\n", fmt::join(study::result_columns(study.script()), ","), plants.names()));
  for (std::uint64_t run = 0; run < study.runs(); ++run) {
    const std::string row = study::result_row(study, run, outcomes[run], {});
    tables.tell(row.substr(0, row.size() - 1) + plants.values(run) + '\n');
  }
  const std::string answer = tables.answer();
  if (const int status = tables.end(); status != 0) return status;
  const auto texts = nlohmann::json::parse(answer);
  for (const auto& [kind, file] : results) file->write(texts.at(kind).get_ref<const std::string&>());
  cli::print(files::for_people(), "{}", texts.at("text").get_ref<const std::string&>());
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

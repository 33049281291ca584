// Makes a study of its file, and its single runs.
#include "program/study_runs.hpp"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "config/factors.hpp"
#include "config/key_table.hpp"
#include "config/library.hpp"
#include "program/questions.hpp"
#include "program/subcommands.hpp"
#include "run/run_summary.hpp"
#include "study/workbench.hpp"

namespace abs_hil::program {

namespace {

std::string text_of(const config::Key& key) {
  return std::visit([](const auto* value) { return fmt::format("{}", *value); }, key.target);
}

/// The assignments that make `wanted` of `given`.
std::vector<std::string> changes(config::Settings given, config::Settings wanted) {
  const config::KeyTable from(given);
  const config::KeyTable to(wanted);
  std::vector<std::string> assignments;
  std::vector<std::string> after;
  for (std::size_t i = 0; i < to.keys().size(); ++i) {
    const config::Key& key = to.keys()[i];
    if (text_of(key) == text_of(from.keys()[i])) continue;
    assignments.push_back(key.name + '=' + text_of(key));
    // Otherwise the model would follow the plant.
    if (const config::Key* model = config::model_key(to.keys(), key.name)) {
      after.push_back(model->name + '=' + text_of(*model));
    }
  }
  assignments.insert(assignments.end(), after.begin(), after.end());
  return assignments;
}

RunOptions with_changes(RunOptions options, const config::Settings& wanted) {
  for (std::string& change : changes(merged_settings(options), wanted))
    options.assignments.push_back(std::move(change));
  return options;
}

}  // namespace

RunOptions options_of_case(const study::StudyScript& script, const std::string& plant, const std::string& experiment) {
  RunOptions options{.plant = plant, .model = script.model, .experiment = experiment};
  options.defaults.push_back(fmt::format("experiment.start_speed_rad_s={}", study_start_speed_rad_s));
  for (const config::Setting& setting : script.settings) {
    options.assignments.push_back(setting.key + '=' + config::text_of(setting.value));
  }
  options.outputs.fast = true;
  options.outputs.no_lcm = true;
  return options;
}

study::Study make_study(study::StudyScript script) {
  std::vector<study::StudyCase> cases;
  for (const std::string& plant : script.plants) {
    for (const std::string& experiment : script.experiments) {
      RunRequest request = merge(options_of_case(script, plant, experiment));
      if (request.script->series.given) {
        throw config::ConfigError(fmt::format(
            "{}: experiment {} is a series of runs; name experiments without [series]", script.path, experiment));
      }
      check_questions(request);
      cases.push_back({.plant = plant, .experiment = experiment, .settings = std::move(request.settings)});
    }
  }
  return {std::move(script), std::move(cases)};
}

std::vector<double> own_metrics(const study::Study& study, std::uint64_t number) {
  const study::RunIndex index = study.index_of(number);
  study::Workbench bench(study);
  config::Settings s = bench.settings_of(index);
  const study::Workbench::Drawn drawn = bench.drawn(index);
  s.plant = drawn.plant;
  s.sensor_seed = std::to_string(drawn.seed);
  const auto controller = control::make_controller(s.control.controller, {s.control, s.model});
  study::SignalMetrics metrics(study.script().metrics, controller->signals(), s.plant.rig.wheels.r2_m);
  static_cast<void>(run::simulate(s, *config::find(s.experiment.name), {&metrics}, [] { return rig::Reason::none; }));
  return metrics.values();
}

void require_run(const study::Study& study, std::uint64_t number) {
  if (number < study.runs()) return;
  throw config::ConfigError(
      fmt::format("--run {}: there are {} runs; give a number in [0, {}]", number, study.runs(), study.runs() - 1));
}

namespace {

/// The options of a run's case, with what makes the run of them.
RunOptions with_run(RunOptions options, const study::Study& study, std::uint64_t number) {
  const study::RunIndex index = study.index_of(number);
  study::Workbench bench(study);
  config::Settings wanted = bench.settings_of(index);
  const study::Workbench::Drawn drawn = bench.drawn(index);
  wanted.plant = drawn.plant;
  wanted.sensor_seed = std::to_string(drawn.seed);
  return with_changes(std::move(options), wanted);
}

}  // namespace

RunOptions on_varied_plant(RunOptions options, const study::Variation& variation, std::uint64_t seed,
                           std::uint64_t index) {
  config::Settings wanted = merged_settings(options);
  const study::Perturbation drawn = study::draw(variation, seed, index);
  wanted.plant = study::perturbed(wanted.plant, drawn);
  wanted.sensor_seed = std::to_string(drawn.sensor_seed);
  return with_changes(std::move(options), wanted);
}

RunOptions options_of_run(const study::Study& study, std::uint64_t number) {
  require_run(study, number);
  const study::StudyCase& one = study.cases()[study.index_of(number).study_case];
  RunOptions options = options_of_case(study.script(), one.plant, one.experiment);
  // Below everything else, as a default is.
  options.assignments.insert(options.assignments.begin(), options.defaults.begin(), options.defaults.end());
  options.defaults.clear();
  return with_run(std::move(options), study, number);
}

int record_run(const study::Study& study, std::uint64_t number, RunOptions options,
               const std::optional<std::string>& folder, const std::vector<std::string>& command_line) {
  options.outputs.fast = true;
  options.outputs.no_lcm = true;
  options.outputs.run_folder = folder;
  RunRequest request = merge(with_run(std::move(options), study, number));
  request.command_line = command_line;
  return run(request);
}

}  // namespace abs_hil::program

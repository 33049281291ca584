// Makes a study of its file, and its single runs.
#include "program/study_runs.hpp"

#include <fmt/format.h>

#include <utility>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "config/library.hpp"
#include "program/answers.hpp"
#include "run/run_summary.hpp"
#include "study/runs.hpp"

namespace abs_hil::program {

namespace {

/// The options that give the settings of a case, before controller and factors.
RunOptions options_of_case(const study::StudyScript& script, const std::string& plant, const std::string& experiment) {
  RunOptions options{.plant = plant, .model = script.model, .experiment = experiment};
  options.defaults.push_back(fmt::format("experiment.start_speed_rad_s={}", study_start_speed_rad_s));
  for (const config::Setting& setting : script.settings) {
    options.changes.push_back({setting.key, setting.value, script.path});
  }
  options.outputs.fast = true;
  options.outputs.no_lcm = true;
  return options;
}

/// The study's own metrics of one run, from its records; the run goes on to the end of its experiment.
std::vector<double> own_metrics(const study::Study& study, std::uint64_t number) {
  const config::Settings s = settings_of_run(study, number);
  const auto controller = control::make_controller(s.control.controller, {s.control, s.model});
  study::SignalMetrics metrics(study.script().metrics, controller->signals(), s.plant.rig.wheels.r2_m);
  static_cast<void>(run::simulate(s, *config::find(s.experiment.name), {&metrics}, [] { return rig::Reason::none; }));
  return metrics.values();
}

}  // namespace

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

study::Tally compute_study(const study::Study& study, const study::StudyFolder& folder, const study::Shard& shard,
                           std::size_t threads, const study::Progress& progress) {
  const study::Tally tally = study::compute(study, folder, shard, threads, own_metrics, progress);
  if (shard.of == 1) folder.merge({});
  return tally;
}

config::Settings settings_of_run(const study::Study& study, std::uint64_t number) {
  if (number >= study.runs()) {
    throw config::ConfigError(
        fmt::format("--run {}: there are {} runs; give a number in [0, {}]", number, study.runs(), study.runs() - 1));
  }
  return study::RunSettings(study).whole(study.index_of(number));
}

}  // namespace abs_hil::program

// Numbers the runs of a study and checks it before any run.
#include "study/study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "analysis/run_metrics.hpp"
#include "config/config_error.hpp"
#include "config/merge.hpp"
#include "rig/nearest_name.hpp"

namespace abs_hil::study {

namespace {

/// Results are numbered and counted in doubles, too.
constexpr double most_runs = 1e12;

std::vector<std::string> names_of_ranges(const StudyScript& script) {
  std::vector<std::string> names;
  for (const Factor& factor : script.factors) {
    if (factor.has_range()) names.push_back(factor.key);
  }
  return names;
}

std::vector<Contender> contenders_of(const std::vector<std::string>& texts, const config::Settings& settings) {
  if (texts.empty()) throw std::invalid_argument("--controllers: empty list; give at least one controller");
  std::vector<Contender> contenders;
  for (const std::string& text : texts) {
    Contender contender = read_contender(text, settings);
    if (std::ranges::any_of(contenders, [&](const Contender& other) { return other.name == contender.name; })) {
      throw std::invalid_argument(fmt::format(
          "--controllers: {0} is given twice; give each once, or a label, as in other={0}", contender.name));
    }
    const config::Settings& s = contender.settings;
    static_cast<void>(control::make_controller(s.control.controller, {s.control, s.model}));
    contenders.push_back(std::move(contender));
  }
  return contenders;
}

}  // namespace

std::vector<std::string> result_columns(const StudyScript& script) {
  std::vector<std::string> columns{"run", "plant", "experiment", "controller", "point", "repetition"};
  for (const Factor& factor : script.factors) columns.push_back(factor.key);
  columns.insert(columns.end(), {"result", "reason"});
  for (const analysis::Figure& figure : analysis::figures) columns.emplace_back(figure.name);
  for (const SignalMetric& metric : script.metrics) columns.push_back(metric.name);
  return columns;
}

Study::Study(StudyScript script, std::vector<StudyCase> cases)
    : script_(std::move(script)),
      cases_(std::move(cases)),
      design_(script_.design.kind, script_.design.points, script_.design.seed, names_of_ranges(script_)) {
  if (script_.repeat.runs < 1) throw std::invalid_argument("--repeat: give a number of at least 1");
  double runs = static_cast<double>(cases_.size()) * static_cast<double>(script_.repeat.runs) *
                static_cast<double>(script_.controllers.size()) * static_cast<double>(design_.rows());
  std::size_t ranges = 0;
  for (const Factor& factor : script_.factors) {
    range_of_factor_.push_back(ranges);
    if (factor.has_range()) ++ranges;
    if (const auto* levels = std::get_if<Levels>(&factor.values)) {
      level_combinations_ *= levels->values.size();
      runs *= static_cast<double>(levels->values.size());
    }
    if (runs > most_runs) {
      throw config::ConfigError(
          fmt::format("{}: the study has {:.3g} runs; give at most {:.0g}", script_.path, runs, most_runs));
    }
  }
  for (const StudyCase& one : cases_) {
    plant_sim::check(one.settings.plant);
    static_cast<void>(config::sensor_seed(one.settings));
    if (!one.settings.inject.empty()) {
      throw config::ConfigError(fmt::format("experiment {}: run.inject = {}: a study injects no faults; leave them out",
                                            one.experiment, one.settings.inject));
    }
    contenders_.push_back(contenders_of(script_.controllers, one.settings));
  }
  check_metrics();
  runs_ = cases_.size() * level_combinations_ * design_.rows() * script_.repeat.runs * contenders_.front().size();
  shares_settings_ = can_share_settings();
}

void Study::check_metrics() const {
  std::vector<std::string> taken = result_columns(script_);
  taken.resize(taken.size() - script_.metrics.size());
  std::vector<std::string_view> known(rig::csv_columns.begin(), rig::csv_columns.end());
  for (const Contender& contender : contenders_.front()) {
    const config::Settings& s = contender.settings;
    for (const rig::Signal& signal : control::make_controller(s.control.controller, {s.control, s.model})->signals()) {
      known.push_back(signal.name);
    }
  }
  for (const SignalMetric& metric : script_.metrics) {
    const std::string place = fmt::format("{}:{}:{}", script_.path, metric.place.line, metric.place.column);
    if (std::ranges::find(known, metric.of) == known.end()) {
      throw config::ConfigError(
          fmt::format("{}: of = \"{}\": no column of a run's CSV and no signal of the study's "
                      "controllers; the nearest is \"{}\"",
                      place, metric.of, rig::nearest_name(metric.of, known)));
    }
    if (std::ranges::find(taken, metric.name) != taken.end()) {
      throw config::ConfigError(
          fmt::format("{}: the results have a column {} already; give the metric another name", place, metric.name));
    }
    taken.push_back(metric.name);
  }
}

bool Study::can_share_settings() const {
  if (script_.factors.empty()) return true;
  if (script_.model_follows_factors()) return false;
  config::Settings settings;
  const config::KeyTable keys(settings);
  const bool numbers_of_plant = std::ranges::all_of(script_.factors, [&keys](const Factor& factor) {
    return factor.key.starts_with("plant.") &&
           std::holds_alternative<double*>(config::find_key(keys.keys(), factor.key)->target);
  });
  // An experiment may look up values of the plant in the settings.
  return numbers_of_plant && std::ranges::none_of(cases_, [](const StudyCase& one) {
           return config::find(one.settings.experiment.name)->text.find("plant.") != std::string::npos;
         });
}

RunIndex Study::index_of(std::uint64_t run) const noexcept {
  RunIndex index;
  const auto take = [&run](std::uint64_t count) { return std::exchange(run, run / count) % count; };
  index.contender = take(contenders_.front().size());
  index.repetition = take(script_.repeat.runs);
  index.point = take(design_.rows());
  index.levels = take(level_combinations_);
  index.study_case = run;
  return index;
}

config::Value Study::value_of(const RunIndex& index, std::size_t factor) const {
  const Factor& wanted = script_.factors[factor];
  if (wanted.has_range()) return quantile(wanted, design_.at(index.point, range_of_factor_[factor]));
  std::uint64_t rest = index.levels;
  for (std::size_t later = script_.factors.size() - 1; later > factor; --later) {
    if (const auto* levels = std::get_if<Levels>(&script_.factors[later].values)) rest /= levels->values.size();
  }
  const auto& values = std::get<Levels>(wanted.values).values;
  return values[rest % values.size()];
}

Study make_study(StudyScript script) {
  std::vector<StudyCase> cases;
  for (const std::string& plant : script.plants) {
    for (const std::string& experiment : script.experiments) {
      config::Sources sources{.plant = plant, .model = script.model, .experiment = experiment};
      sources.defaults.emplace_back(start_speed_default);
      for (const config::Setting& setting : script.settings) {
        sources.changes.push_back({setting.key, setting.value, script.path});
      }
      sources.virtual_time = true;
      config::Configuration merged = config::merge(sources);
      if (merged.script->series.given) {
        throw config::ConfigError(fmt::format(
            "{}: experiment {} is a series of runs; name experiments without [series]", script.path, experiment));
      }
      cases.push_back({.plant = plant, .experiment = experiment, .settings = std::move(merged.settings)});
    }
  }
  return {std::move(script), std::move(cases)};
}

}  // namespace abs_hil::study

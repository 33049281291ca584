// Settings of a study's runs, and batches of them.
#include "study/runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "config/config_error.hpp"

namespace abs_hil::study {

namespace {

/// Gives an option a value that its key has checked, when the study was read.
void assign(const rig::OptionTarget& target, const config::Value& value) {
  std::visit(
      [&value](auto* to) {
        using To = std::remove_cvref_t<decltype(*to)>;
        if constexpr (std::is_same_v<To, bool> || std::is_same_v<To, std::string>) {
          *to = std::get<To>(value);
        } else if (const auto* whole = std::get_if<std::int64_t>(&value)) {
          *to = static_cast<To>(*whole);
        } else {
          *to = static_cast<To>(std::get<double>(value));
        }
      },
      target);
}

bool equal(const rig::OptionTarget& a, const rig::OptionTarget& b) {
  return std::visit([&b](auto* value) { return *value == *std::get<decltype(value)>(b); }, a);
}

/// Makes the jobs of neighbouring runs, and keeps their settings, which a job only points to. Runs that differ in their
/// varied plant alone share them, since what a batch prepares from settings costs more than a copy.
class Jobs {
 public:
  explicit Jobs(const Study& study) : study_(study), run_(study), latest_(study.contenders(0).size()) {}

  Job job_of(std::uint64_t run) {
    const RunIndex index = study_.index_of(run);
    const config::Settings* settings = &study_.contenders(index.study_case)[index.contender].settings;
    if (!study_.shares_settings()) {
      auto& [at, own] = latest_[index.contender];
      if (own == nullptr || !at.same_settings(index)) own = &settings_.emplace_back(run_.of(index));
      at = index;
      settings = own;
    }
    RunSettings::Drawn drawn = run_.drawn(index);
    return {.settings = settings, .plant = std::move(drawn.plant), .seed = drawn.seed};
  }

 private:
  const Study& study_;
  RunSettings run_;
  std::deque<config::Settings> settings_{};
  std::vector<std::pair<RunIndex, const config::Settings*>> latest_;  ///< by controller
};

}  // namespace

RunSettings::RunSettings(const Study& study)
    : study_(study), settings_(study.cases().front().settings), keys_(settings_) {
  for (const Factor& factor : study.script().factors) {
    Target& target = targets_.emplace_back(Target{config::find_key(keys_.keys(), factor.key)->target});
    const config::Key* model = config::model_key(keys_.keys(), factor.key);
    const bool is_factor = model != nullptr && std::ranges::any_of(study.script().factors, [&](const Factor& other) {
                             return other.key == model->name;
                           });
    if (study.script().model_follows_factors() && model != nullptr && !is_factor) target.model = model->target;
  }
  follows_.resize(targets_.size());
}

void RunSettings::take_over(const RunIndex& index) {
  settings_ = study_.contenders(index.study_case)[index.contender].settings;
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    // A value of the model that differs from the plant's was set by somebody: it does not follow (KeyTable).
    const Target& target = targets_[i];
    follows_[i] = target.model && equal(target.value, *target.model);
  }
}

const config::Settings& RunSettings::of(const RunIndex& index) {
  if (at_ && at_->same_settings(index)) return settings_;
  const bool same_base = at_ && at_->study_case == index.study_case && at_->contender == index.contender;
  if (!same_base) take_over(index);
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    const config::Value value = study_.value_of(index, i);
    assign(targets_[i].value, value);
    if (follows_[i]) assign(*targets_[i].model, value);
  }
  at_ = index;
  return settings_;
}

RunSettings::Drawn RunSettings::drawn(const RunIndex& index) {
  const config::Settings& settings = of(index);
  const StudyScript& script = study_.script();
  const auto seed = config::sensor_seed(settings);
  if (script.repeat.variation == Variation{}) return {.plant = settings.plant, .seed = seed};
  const Perturbation perturbation = draw(script.repeat.variation, script.repeat.seed, index.repetition);
  return {.plant = perturbed(settings.plant, perturbation),
          .seed = script.repeat.variation.phase ? perturbation.sensor_seed : seed};
}

config::Settings RunSettings::whole(const RunIndex& index) {
  config::Settings settings = of(index);
  Drawn own = drawn(index);
  settings.plant = std::move(own.plant);
  settings.sensor_seed = std::to_string(own.seed);
  return settings;
}

config::Settings settings_of_run(const Study& study, std::uint64_t number) {
  if (number >= study.runs()) {
    throw config::ConfigError(
        fmt::format("--run {}: there are {} runs; give a number in [0, {}]", number, study.runs(), study.runs() - 1));
  }
  return RunSettings(study).whole(study.index_of(number));
}

void run_part(const Study& study, std::size_t count, std::size_t threads,
              const std::function<std::uint64_t(std::size_t)>& run_of,
              const std::function<void(std::size_t, Outcome)>& take) {
  const std::function<JobSource()> new_source = [&study, &run_of]() -> JobSource {
    return [jobs = std::make_shared<Jobs>(study), &run_of](std::size_t index) { return jobs->job_of(run_of(index)); };
  };
  run_batch(count, threads, new_source, take);
}

}  // namespace abs_hil::study

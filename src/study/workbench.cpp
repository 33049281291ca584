#include "study/workbench.hpp"

#include <algorithm>
#include <type_traits>

namespace abs_hil::study {

namespace {

/// The value has passed its key's check, when the study was read.
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

}  // namespace

Workbench::Workbench(const Study& study) : study_(study), settings_(study.cases().front().settings), keys_(settings_) {
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

void Workbench::take_over(const RunIndex& index) {
  settings_ = study_.contenders(index.study_case)[index.contender].settings;
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    // A value of the model that differs from the plant's was set by somebody: it does not follow (KeyTable).
    const Target& target = targets_[i];
    follows_[i] = target.model && equal(target.value, *target.model);
  }
}

const config::Settings& Workbench::settings_of(const RunIndex& index) {
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

Workbench::Drawn Workbench::drawn(const RunIndex& index) {
  const config::Settings& settings = settings_of(index);
  const StudyScript& script = study_.script();
  const auto seed = config::sensor_seed(settings);
  if (script.repeat.variation == Variation{}) return {.plant = settings.plant, .seed = seed};
  const Perturbation perturbation = draw(script.repeat.variation, script.repeat.seed, index.repetition);
  return {.plant = perturbed(settings.plant, perturbation),
          .seed = script.repeat.variation.phase ? perturbation.sensor_seed : seed};
}

}  // namespace abs_hil::study

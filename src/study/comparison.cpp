#include "study/comparison.hpp"

#include <atomic>
#include <stdexcept>
#include <utility>

#include "study/run_part.hpp"

namespace abs_hil::study {

Study study_of(const ComparisonPlan& plan) {
  if (plan.repeat < 1) throw std::invalid_argument("--repeat: give a number of at least 1");
  StudyScript script{.controllers = plan.controllers,
                     .repeat = {.runs = plan.repeat, .seed = plan.seed, .variation = plan.variation},
                     .path = "compare"};
  return {
      std::move(script),
      {{.plant = plan.settings.plant_name, .experiment = plan.settings.experiment.name, .settings = plan.settings}}};
}

std::vector<Contender> contenders_of(const ComparisonPlan& plan) { return study_of(plan).contenders(0); }

Comparison compare(const ComparisonPlan& plan, const std::function<void(std::size_t)>& done) {
  const Study study = study_of(plan);
  Comparison comparison{.contenders = study.contenders(0)};
  const std::size_t kinds = comparison.contenders.size();
  comparison.results.assign(kinds, std::vector<RunResult>(plan.repeat));
  std::atomic<std::size_t> finished{0};
  run_part(
      study, study.runs(), plan.threads, [](std::size_t index) { return index; },
      [&](std::size_t index, const Outcome& outcome) {
        if (!outcome.refusal.empty()) throw std::invalid_argument(outcome.refusal);
        comparison.results[index % kinds][index / kinds] = outcome.run;
        if (done) done(finished.fetch_add(1) + 1);
      });
  return comparison;
}

}  // namespace abs_hil::study

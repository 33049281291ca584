#include "study/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "study/batch.hpp"

namespace abs_hil::study {

std::vector<Contender> contenders_of(const ComparisonPlan& plan) {
  if (plan.controllers.empty()) throw std::invalid_argument("--controllers: empty list; give at least one controller");
  std::vector<Contender> contenders;
  for (const std::string& text : plan.controllers) {
    Contender contender = read_contender(text, plan.settings);
    const auto has_its_name = [&contender](const Contender& other) { return other.name == contender.name; };
    if (std::any_of(contenders.begin(), contenders.end(), has_its_name)) {
      throw std::invalid_argument(fmt::format(
          "--controllers: {0} is given twice; give each once, or a label, as in other={0}", contender.name));
    }
    const config::Settings& s = contender.settings;
    static_cast<void>(control::make_controller(s.control.controller, {s.control, s.model}));
    contenders.push_back(std::move(contender));
  }
  return contenders;
}

Comparison compare(const ComparisonPlan& plan, const std::function<void(std::size_t)>& done) {
  if (plan.repeat < 1) throw std::invalid_argument("--repeat: give a number of at least 1");
  plant_sim::check(plan.settings.plant);
  Comparison comparison{.contenders = contenders_of(plan)};
  const std::size_t kinds = comparison.contenders.size();
  comparison.results.assign(kinds, std::vector<RunResult>(plan.repeat));
  std::atomic<std::size_t> finished{0};
  const auto job_of = [&](std::size_t index) -> Job {
    const Perturbation perturbation = draw(plan.variation, plan.seed, index / kinds);
    return {.settings = &comparison.contenders[index % kinds].settings,
            .plant = perturbed(plan.settings.plant, perturbation),
            .seed = perturbation.sensor_seed};
  };
  run_batch(kinds * plan.repeat, plan.threads, job_of, [&](std::size_t index, const Outcome& outcome) {
    if (!outcome.refusal.empty()) throw std::invalid_argument(outcome.refusal);
    comparison.results[index % kinds][index / kinds] = outcome.run;
    if (done) done(finished.fetch_add(1) + 1);
  });
  return comparison;
}

}  // namespace abs_hil::study

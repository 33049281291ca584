#include "study/comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "study/parallel.hpp"

namespace abs_hil::study {

namespace {

void check(const ComparisonPlan& plan) {
  if (plan.controllers.empty()) throw std::invalid_argument("--controllers: empty list; give at least one controller");
  if (plan.repeat < 1) throw std::invalid_argument("--repeat: give a number of at least 1");
  plant_sim::check(plan.settings.plant);
  for (auto name = plan.controllers.begin(); name != plan.controllers.end(); ++name) {
    if (std::find(plan.controllers.begin(), name, *name) != name) {
      throw std::invalid_argument(fmt::format("--controllers: {} is given twice; give each controller once", *name));
    }
    static_cast<void>(control::make_controller(*name, {plan.settings.control, plan.settings.model}));
  }
}

}  // namespace

Comparison compare(const ComparisonPlan& plan, const std::function<void(std::size_t)>& done) {
  check(plan);
  const std::size_t kinds = plan.controllers.size();
  std::vector<config::Settings> settings(kinds, plan.settings);
  for (std::size_t c = 0; c < kinds; ++c) settings[c].control.controller = plan.controllers[c];

  Comparison comparison{.results = {kinds, std::vector<RunResult>(plan.repeat)}};
  std::atomic<std::size_t> finished{0};
  for_each_index(kinds * plan.repeat, plan.threads, [&](std::size_t index) {
    const std::size_t c = index % kinds;
    const std::size_t k = index / kinds;
    const Perturbation perturbation = draw(plan.variation, plan.seed, k);
    comparison.results[c][k] =
        simulate(settings[c], perturbed(plan.settings.plant, perturbation), perturbation.sensor_seed);
    if (done) done(finished.fetch_add(1) + 1);
  });
  return comparison;
}

}  // namespace abs_hil::study

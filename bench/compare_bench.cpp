// Cost of `abs_hil compare`: 1,000 perturbed braking runs, 500 of each of two controllers, on all processors.

#include <benchmark/benchmark.h>

#include "study/comparison.hpp"
#include "study/parallel.hpp"

namespace {

using namespace abs_hil::study;

ComparisonPlan plan(std::size_t repeat, std::size_t threads) {
  ComparisonPlan plan{.controllers = {"adaptive", "sliding-mode"}, .repeat = repeat, .seed = 3, .threads = threads};
  plan.settings.experiment.start_speed_rad_s = 170.0;
  return plan;
}

void thousand_runs(benchmark::State& state) {
  const ComparisonPlan p = plan(500, machine_threads());
  for (auto _ : state) benchmark::DoNotOptimize(compare(p));
  state.counters["threads"] = static_cast<double>(p.threads);
}

void one_run(benchmark::State& state, const char* controller) {
  ComparisonPlan p = plan(1, 1);
  p.settings.control.controller = controller;
  const abs_hil::run::Prepared prepared(p.settings);
  for (auto _ : state) benchmark::DoNotOptimize(simulate(prepared, p.settings.plant, 1));
}

BENCHMARK(thousand_runs)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(one_run, adaptive, "adaptive")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(one_run, sliding_mode, "sliding-mode")->Unit(benchmark::kMillisecond);

}  // namespace

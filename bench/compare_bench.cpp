// Cost of `abs_hil compare`: 1,000 perturbed braking runs, 500 of each of two controllers, on all processors.

#include <benchmark/benchmark.h>

#include "run/parallel.hpp"
#include "study/compute.hpp"

namespace {

using namespace abs_hil;
using namespace abs_hil::study;

abs_hil::config::Settings settings_of(const char* controller) {
  abs_hil::config::Settings settings;
  settings.experiment.start_speed_rad_s = 170.0;
  settings.control.controller = controller;
  return settings;
}

void thousand_runs(benchmark::State& state) {
  const Study study({.controllers = {"adaptive", "sliding-mode"},
                     .repeat = {.runs = 500, .seed = 3, .variation = Variation::standard()}},
                    {{.settings = settings_of("adaptive")}});
  const std::size_t threads = run::machine_threads();
  std::vector<Outcome> outcomes(study.runs());
  for (auto _ : state) {
    run_part(
        study, study.runs(), threads, [](std::size_t index) { return index; },
        [&outcomes](std::size_t index, Outcome outcome) { outcomes[index] = std::move(outcome); });
    benchmark::DoNotOptimize(outcomes.data());
  }
  state.counters["threads"] = static_cast<double>(threads);
}

void one_run(benchmark::State& state, const char* controller) {
  const abs_hil::config::Settings settings = settings_of(controller);
  const abs_hil::run::Prepared prepared(settings);
  for (auto _ : state) benchmark::DoNotOptimize(simulate(prepared, settings.plant, 1));
}

BENCHMARK(thousand_runs)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(one_run, adaptive, "adaptive")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(one_run, sliding_mode, "sliding-mode")->Unit(benchmark::kMillisecond);

}  // namespace

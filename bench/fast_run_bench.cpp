// Cost of a whole simulated run in virtual time, by the program's own code, without start-up.

#include <benchmark/benchmark.h>

#include <string>

#include "experiment/simulated_run.hpp"

namespace {

using namespace abs_hil::experiment::test;

void paper_run(benchmark::State& state) {
  const Setup setup;
  double simulated_s = 0.0;
  for (auto _ : state) {
    const Result result = simulated(setup);
    simulated_s = result.records.back().time_s;
  }
  state.counters["simulated_s"] = simulated_s;
}

void braking_run(benchmark::State& state, const std::string& controller) {
  const Setup setup = braking(controller);
  double stop_m = 0.0;
  for (auto _ : state) stop_m = simulated(setup).metrics.stop_distance_m;
  state.counters["stop_m"] = stop_m;
}

BENCHMARK(paper_run)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(braking_run, nominal, "nominal")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(braking_run, adaptive, "adaptive")->Unit(benchmark::kMillisecond);

}  // namespace

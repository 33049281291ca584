// Runs a second on one core: braking runs on varied plants as `abs_hil compare` makes them, by the scalar path and in
// the lanes of each instruction set that the computer has.

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "study/batch.hpp"
#include "study/lanes/lane_jobs.hpp"
#include "study/variation.hpp"

namespace {

using namespace abs_hil;
using namespace abs_hil::study;

constexpr std::size_t runs_in_lanes = 768;
constexpr std::size_t runs_alone = 100;

void runs(benchmark::State& state, const std::string& set, const std::string& plant, const std::string& controller) {
  setenv("ABS_HIL_LANES", set.c_str(), 1);
  config::Settings settings;
  config::KeyTable keys(settings);
  config::load_file(config::plant_file(plant), keys, config::Tables::of_plant);
  settings.experiment.start_speed_rad_s = 170.0;
  settings.control.controller = controller;
  const std::size_t count = set == "none" ? runs_alone : runs_in_lanes;
  std::vector<Job> jobs;
  for (std::size_t i = 0; i < count; ++i) {
    const Perturbation perturbation = draw(Variation::standard(), 3, i);
    jobs.push_back({&settings, perturbed(settings.plant, perturbation), perturbation.sensor_seed});
  }
  BatchCounts counts;
  for (auto _ : state) {
    counts = run_batch(
        count, 1, [&](std::size_t i) { return jobs[i]; },
        [](std::size_t, const Outcome& outcome) { benchmark::DoNotOptimize(outcome.run.metrics); });
  }
  state.counters["runs_per_s"] = benchmark::Counter(
      static_cast<double>(count * static_cast<std::size_t>(state.iterations())), benchmark::Counter::kIsRate);
  state.counters["in_lanes"] = static_cast<double>(counts.lanes) / static_cast<double>(count);
}

bool has(const char* set) {
  setenv("ABS_HIL_LANES", set, 1);
  try {
    static_cast<void>(lanes::instruction_set());
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (const char* plant : {"paper-table1", "inteco-manual"}) {
    for (const char* controller : {"adaptive", "nominal", "sliding-mode", "pi", "adaptive-actuator"}) {
      for (const char* set : {"none", "portable", "avx2", "avx512"}) {
        if (!has(set)) continue;
        const std::string name = std::string(plant) + "/" + controller + "/" + set;
        benchmark::RegisterBenchmark(name.c_str(), runs, set, plant, controller)->Unit(benchmark::kMillisecond);
      }
    }
  }
  benchmark::RunSpecifiedBenchmarks();
}

// Runs a second of CPU time: braking runs on varied plants as `abs_hil compare` makes them, by the scalar path and in
// the lanes of each instruction set that the computer has; and, as the limit, the bare plant by hand (bare_plant.hpp).

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "bare_plant.hpp"
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

/// A patch of half the friction in every second stretch of 2 m.
constexpr const char* patches =
    "braking distance: 1; 0.5 at 2; 1 at 4; 0.5 at 6; 1 at 8; 0.5 at 10; 1 at 12; 0.5 at 14; 1 at 16; 0.5 at 18";

struct Workload {
  std::string plant;
  std::string controller;
  bool on_patches{false};
  std::size_t threads{1};
};

config::Settings settings_of(const Workload& work) {
  config::Settings settings;
  config::KeyTable keys(settings);
  config::load_file(config::plant_file(work.plant), keys, config::Tables::of_plant);
  settings.experiment.start_speed_rad_s = 170.0;
  settings.control.controller = work.controller;
  if (work.on_patches) settings.plant.friction_profile = patches;
  return settings;
}

/// False if lanes do not know such runs.
bool has_lanes(const Workload& work) {
  setenv("ABS_HIL_LANES", "portable", 1);
  const config::Settings settings = settings_of(work);
  const BatchCounts counts = run_batch(
      1, 1, [&](std::size_t) { return Job{.settings = &settings, .plant = settings.plant}; },
      [](std::size_t, const Outcome&) {});
  return counts.scalar == 0;
}

void runs(benchmark::State& state, const std::string& set, const Workload& work) {
  setenv("ABS_HIL_LANES", set.c_str(), 1);
  const config::Settings settings = settings_of(work);
  const std::size_t count = work.threads * (set == "none" ? runs_alone : runs_in_lanes);
  std::vector<Job> jobs;
  for (std::size_t i = 0; i < count; ++i) {
    const Perturbation perturbation = draw(Variation::standard(), 3, i);
    jobs.push_back({&settings, perturbed(settings.plant, perturbation), perturbation.sensor_seed});
  }
  BatchCounts counts;
  for (auto _ : state) {
    counts = run_batch(
        count, work.threads, [&](std::size_t i) { return jobs[i]; },
        [](std::size_t, const Outcome& outcome) { benchmark::DoNotOptimize(outcome.run.metrics); });
  }
  state.counters["runs_per_s"] = benchmark::Counter(
      static_cast<double>(count * static_cast<std::size_t>(state.iterations())), benchmark::Counter::kIsRate);
  state.counters["in_lanes"] = static_cast<double>(counts.lanes) / static_cast<double>(count);
}

#if defined(__x86_64__)
void bare(benchmark::State& state, const bare_plant::Kernel& kernel) {
  constexpr double step_s = 500e-6;
  constexpr int steps = 4000;
  const std::vector<bare_plant::Tyre> tyres(kernel.lanes, {.theta_N = 23.0, .B = 28.0, .C = 1.68});
  std::vector<double> omega1(kernel.lanes);
  for (auto _ : state) {
    kernel.brake(tyres.data(), 170.0, 0.55, steps, step_s, omega1.data());
    benchmark::DoNotOptimize(omega1.data());
  }
  state.counters["runs_per_s"] = benchmark::Counter(
      static_cast<double>(kernel.lanes * static_cast<std::size_t>(state.iterations())), benchmark::Counter::kIsRate);
  state.counters["omega1_rad_s"] = omega1[0];
}
#endif

bool has(const char* set) {
  setenv("ABS_HIL_LANES", set, 1);
  try {
    static_cast<void>(lanes::instruction_set());
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

void add(const std::string& name, const Workload& work) {
  const bool lanes = has_lanes(work);
  for (const char* set : {"none", "portable", "avx2", "avx512"}) {
    if (!has(set) || (!lanes && std::string(set) != "none")) continue;
    benchmark::RegisterBenchmark((name + "/" + set).c_str(), runs, set, work)
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime();
  }
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  for (const char* plant : {"paper-table1", "inteco-manual"}) {
    for (const control::ControllerEntry& entry : control::controllers()) {
      const std::string controller(entry.name);
      add(std::string(plant) + "/" + controller, {plant, controller});
    }
  }
  add("paper-table1 on patches/adaptive", {"paper-table1", "adaptive", true});
  add("paper-table1 on 2 threads/adaptive", {"paper-table1", "adaptive", false, 2});
#if defined(__x86_64__)
  for (const auto& [name, kernel] :
       {std::pair{"bare/hand/avx2", bare_plant::avx2()}, {"bare/hand/avx512", bare_plant::avx512()}}) {
    if (kernel.brake != nullptr) benchmark::RegisterBenchmark(name, bare, kernel)->Unit(benchmark::kMillisecond);
  }
#endif
  benchmark::RunSpecifiedBenchmarks();
}

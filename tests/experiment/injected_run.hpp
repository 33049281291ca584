#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "config/injection.hpp"
#include "injection/injecting_driver.hpp"
#include "simulated_run.hpp"

namespace abs_hil::experiment::test {

/// A simulated run into which faults were injected.
struct InjectedResult {
  run::RunOutcome outcome{};
  std::vector<rig::CycleRecord> records{};
  plant_sim::PlantInput outputs{};  ///< those that acted on the rig when the run was over
};

/// Every read takes this part of the period.
inline config::Injection slow_reads(double share, double rate_Hz) {
  return config::parse_injection("any@read:slow=" + std::to_string(share / rate_Hz) + "s");
}

inline InjectedResult run_injected(const Setup& setup, const std::vector<config::Injection>& faults) {
  runtime::VirtualClock clock;
  auto rig = std::make_unique<driver::SimDriver>(
      setup.plant, driver::SimStart{.seed = setup.seed, .start_speed_rad_s = setup.experiment.start_speed_rad_s});
  const driver::SimDriver& sim = *rig;
  injection::InjectingDriver driver(std::move(rig), faults, setup.seed, [&clock](std::int64_t duration_ns) {
    clock.sleep_until(clock.now_ns() + duration_ns);
  });
  Recorder recorder;
  SetupRun run(setup, {.clock = &clock, .driver = &driver});
  run->record_into({&recorder});
  const run::RunOutcome outcome = run->go(go_on);
  return {.outcome = outcome, .records = std::move(recorder.records), .outputs = sim.outputs()};
}

}  // namespace abs_hil::experiment::test

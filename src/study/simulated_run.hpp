#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"
#include "analysis/run_metrics.hpp"
#include "run/run.hpp"

namespace abs_hil::study {

/// Result of a simulated run.
struct RunResult {
  analysis::Metrics metrics{};
  rig::Reason fault{rig::Reason::none};  ///< reason of an early end; the metrics then cover the run up to it
  [[nodiscard]] bool stopped() const noexcept { return fault == rig::Reason::none; }
};

/// Runs one experiment in virtual time in the calling thread, through the program's own cycle, until its metrics are
/// complete. It leaves out the hold phase after braking. The result depends on the arguments alone, not on the thread.
/// @param plant  the true parameters of the rig
/// @param seed  seed of the simulator: the encoders' initial position within a count
/// Throws std::invalid_argument for unusable options.
[[nodiscard]] inline RunResult simulate(const run::Prepared& prepared, const plant_sim::PlantOptions& plant,
                                        std::uint64_t seed) {
  run::Run run(prepared, {.stepped = true, .plant = &plant, .sensor_seed = seed});
  run.begin();
  while (run.cycle() && !run.metrics().complete()) {
  }
  // The last cycle of a complete sequence has a reason that is not a fault; an early end has a limit or fault.
  const rig::Reason end = run.end_reason();
  return {.metrics = run.metrics().metrics(), .fault = rig::is_fault(end) ? end : rig::Reason::none};
}

}  // namespace abs_hil::study

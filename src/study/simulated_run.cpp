// One run until its metrics are complete.
#include "study/simulated_run.hpp"

namespace abs_hil::study {

RunResult simulate(const run::Prepared& prepared, const plant_sim::PlantOptions& plant, std::uint64_t seed) {
  run::Run run(prepared, {.stepped = true, .plant = &plant, .sensor_seed = seed});
  run.begin();
  while (run.cycle() && !run.metrics().complete()) {
  }
  // The last cycle of a complete sequence has a reason that is not a fault; an early end has a limit or fault.
  const rig::Reason end = run.end_reason();
  return {.metrics = run.metrics().metrics(), .fault = rig::is_fault(end) ? end : rig::Reason::none};
}

}  // namespace abs_hil::study

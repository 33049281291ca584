#include "abs_hil/comparison/simulated_run.hpp"

#include <cmath>
#include <utility>

#include "abs_hil/driver/sim/sim_driver.hpp"
#include "abs_hil/experiment/run_logic.hpp"
#include "abs_hil/runtime/clock.hpp"
#include "abs_hil/runtime/command_gate.hpp"
#include "abs_hil/runtime/cyclic_executive.hpp"
#include "abs_hil/runtime/record_pump.hpp"
#include "abs_hil/script/plan.hpp"

namespace abs_hil::comparison {

namespace {

/// Emptied after every cycle: RunSession's ring, made for a slow disk, would cost more to clear than the run to
/// compute.
constexpr std::size_t ring_capacity = 2;

}  // namespace

RunResult simulate(const settings::Settings& settings, const plant_sim::PlantOptions& plant, std::uint64_t seed) {
  runtime::VirtualClock clock;
  driver::SimDriver driver(plant, {.seed = seed, .start_speed_rad_s = settings.experiment.start_speed_rad_s});
  script::Plan plan = script::plan(settings);
  experiment::RunLogic logic(experiment::make_logic_parts(settings.control, settings.plant.rig,
                                                          settings.plant.ideal_actuator, settings.gate,
                                                          settings.experiment, std::move(plan.phases), plan.limits));
  runtime::CommandGate gate = logic.make_gate(settings.gate);
  runtime::RecordRing ring(ring_capacity);
  runtime::CyclicExecutive executive(clock, driver, logic, gate, ring, std::llround(1e9 / settings.control.rate_Hz));
  analysis::RunMetrics metrics(plant.rig.wheels.r2_m, settings.experiment.end_speed_m_s);
  runtime::RecordPump pump(ring, plant.rig.wheels.r2_m, {&metrics});

  driver.configure();
  driver.activate(clock.now_ns());
  bool running = true;
  while (running && !metrics.complete()) {
    running = executive.step();
    pump.drain();
  }
  // The last cycle of a whole sequence ends with a reason that is no fault; an early end by a limit or fault is one.
  const rig::Reason end = logic.end_reason();
  return {.metrics = metrics.metrics(), .fault = rig::is_fault(end) ? end : rig::Reason::none};
}

}  // namespace abs_hil::comparison

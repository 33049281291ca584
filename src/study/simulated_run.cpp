#include "study/simulated_run.hpp"

#include <cmath>
#include <utility>

#include "driver/sim/sim_driver.hpp"
#include "experiment/run_logic.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/record_pump.hpp"

namespace abs_hil::study {

namespace {

/// The ring is emptied after every cycle. RunSession's larger ring is made for a slow disk, and clearing it would cost
/// more than computing the run.
constexpr std::size_t ring_capacity = 2;

}  // namespace

PreparedSettings::PreparedSettings(const config::Settings& s)
    : settings(s), plan(config::plan(s)), to_stop(config::means_to_stop(plan, s.experiment.end_speed_m_s)) {}

RunResult simulate(const PreparedSettings& prepared, const plant_sim::PlantOptions& plant, std::uint64_t seed) {
  const config::Settings& settings = prepared.settings;
  runtime::VirtualClock clock;
  driver::SimDriver driver(plant, {.seed = seed,
                                   .start_speed_rad_s = settings.experiment.start_speed_rad_s,
                                   .pwm_mode = driver::pwm_mode_named(settings.driver.sim.pwm_mode)});
  experiment::RunLogicParts parts = experiment::make_logic_parts(
      settings.control, settings.model, plant_sim::identity_of(plant), settings.plant.ideal_actuator, settings.gate,
      settings.experiment, prepared.plan.phases, prepared.plan.limits);
  parts.duty_steps = driver::simulated_output_grid(settings.driver, plant.ideal_actuator).duty_steps;
  experiment::RunLogic logic(std::move(parts));
  runtime::CommandGate gate = logic.make_gate(settings.gate);
  runtime::RecordRing ring(ring_capacity);
  runtime::CyclicExecutive executive(clock, driver, logic, gate, ring, std::llround(1e9 / settings.control.rate_Hz), {},
                                     false);
  analysis::RunMetrics metrics(plant.rig.wheels.r2_m, settings.experiment.end_speed_m_s);
  runtime::RecordPump pump(ring, plant.rig.wheels.r2_m, {&metrics});

  driver.configure();
  driver.activate(clock.now_ns());
  bool running = true;
  while (running && !metrics.complete()) {
    running = executive.step();
    pump.drain();
  }
  // The last cycle of a complete sequence has a reason that is not a fault; an early end has a limit or fault.
  rig::Reason end = logic.end_reason();
  if (end == rig::Reason::sequence_complete && prepared.to_stop && metrics.moves_on())
    end = rig::Reason::braking_without_stop;
  return {.metrics = metrics.metrics(), .fault = rig::is_fault(end) ? end : rig::Reason::none};
}

}  // namespace abs_hil::study

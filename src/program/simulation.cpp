#include "program/simulation.hpp"

#include <optional>
#include <utility>

#include "analysis/friction_curve.hpp"
#include "config/config_error.hpp"
#include "config/plan.hpp"
#include "program/run_parts.hpp"
#include "program/run_results.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::program {

Simulation simulate(RunRequest request, std::vector<rig::RecordSink*> sinks, const experiment::RunSession::Poll& poll) {
  const config::Settings& s = request.settings;
  if (s.on_rig()) throw config::ConfigError("backend rig: only the simulated rig runs here; leave out the backend");
  if (s.experiment.wait_for_start) {
    throw config::ConfigError("experiment.wait_for_start: a run in virtual time cannot wait; leave it out");
  }
  if (request.script->series.given) {
    throw config::ConfigError("experiment " + request.script->name +
                              ": a series of runs, and this is one run; give an experiment without [series]");
  }
  request.outputs.fast = true;
  runtime::VirtualClock clock;
  const std::unique_ptr<driver::RigDriver> driver = with_faults(make_driver(s, true), s, clock);
  config::Plan plan = config::plan(*request.script, s);
  const bool to_stop = config::means_to_stop(plan, s.experiment.end_speed_m_s);
  experiment::RunLogicParts logic = make_logic(s, std::move(plan.phases), plan.limits);
  Simulation simulation{.names = logic.names};
  analysis::RunMetrics metrics(s.plant.rig.wheels.r2_m, s.experiment.end_speed_m_s);
  sinks.push_back(&metrics);
  std::optional<analysis::FrictionCurve> friction_curve;
  if (request.script->analysis == "friction-curve") {
    sinks.push_back(&friction_curve.emplace(s.model.wheels, s.model.encoder_counts_per_rev));
  }
  experiment::RunSession session(clock, *driver, std::move(logic), s.gate, std::move(sinks), s.realtime.overruns);
  experiment::RunOutcome outcome = session.run_fast(poll);
  if (outcome.completed() && to_stop && metrics.moves_on()) {
    outcome.reason = rig::Reason::braking_without_stop;
    outcome.reason_value = metrics.metrics().final_speed_m_s;
  }
  RunResults results{.metrics = metrics.metrics(), .names = simulation.names};
  if (friction_curve) results.friction_curve = analysis::to_json(friction_curve->result());
  simulation.summary = summarise(request, session, outcome, results);
  return simulation;
}

}  // namespace abs_hil::program

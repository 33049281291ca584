#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "abs_hil/analysis/run_metrics.hpp"
#include "abs_hil/analysis/run_summary.hpp"
#include "abs_hil/control/registry.hpp"
#include "abs_hil/driver/factory.hpp"
#include "abs_hil/driver/sim/sim_driver.hpp"
#include "abs_hil/experiment/experiments.hpp"
#include "abs_hil/experiment/run_session.hpp"
#include "abs_hil/settings/config_error.hpp"
#include "abs_hil/telemetry/file_error.hpp"
#include "commands.hpp"
#include "exit_status.hpp"
#include "run_outputs.hpp"
#include "signals.hpp"

namespace abs_hil::app {

namespace {

std::unique_ptr<driver::RigDriver> make_driver(const settings::Settings& s) {
  if (s.backend == "rig") return driver::make_rig_driver(s.driver);
  return std::make_unique<driver::SimDriver>(s.plant,
                                             driver::SimStart{.seed = static_cast<std::uint64_t>(s.seed),
                                                              .start_speed_rad_s = s.experiment.start_speed_rad_s});
}

experiment::RunLogicParts make_logic(const settings::Settings& s) {
  return {.control = s.control,
          .rig = s.plant.rig,
          .controller = control::make_controller(s.control.controller, {s.control, s.plant.rig}),
          .sequence = experiment::Sequence(experiment::plan_experiment(s.experiment, s.control.v_min_m_s)),
          .ideal_actuator = s.plant.ideal_actuator,
          .max_brake_duty = s.gate.brake_duty_max,
          .start_speed_rad_s = s.experiment.start_speed_rad_s};
}

std::string reason_text(const experiment::RunOutcome& outcome) {
  std::string text(rig::description(outcome.reason));
  if (rig::is_fault(outcome.reason)) text += fmt::format(" (value {:.6g})", outcome.reason_value);
  if (!outcome.io_error.ok()) {
    text += fmt::format(": {} at {:#x}", driver::description(outcome.io_error.error), outcome.io_error.where);
  }
  return text;
}

analysis::RunSummary summarise(const RunRequest& request, const experiment::RunSession& session,
                               const experiment::RunOutcome& outcome, const RunOutputs& outputs) {
  const settings::Settings& s = request.settings;
  const std::string result = outcome.completed() ? "completed" : (rig::is_fault(outcome.reason) ? "fault" : "stopped");
  return {.result = result,
          .reason = reason_text(outcome),
          .controller = s.control.controller,
          .plant = s.plant_name,
          .backend = s.backend,
          .experiment = s.experiment.name,
          .metrics = outputs.metrics(),
          .cycles = session.executive().counters().cycles,
          .overruns = session.executive().counters().overruns,
          .telemetry_drops = session.record_drops(),
          .publish_failures = outputs.publish_failures(),
          .realtime = outcome.realtime.realtime(),
          .virtual_time = request.outputs.fast,
          .truth_known = s.backend == "sim",
          .wakeup_latency =
              request.outputs.fast ? rig::DurationQuantiles{} : session.executive().wakeup_latency().summary(),
          .cycle_time = request.outputs.fast ? rig::DurationQuantiles{} : session.executive().cycle_time().summary(),
          .config = nlohmann::ordered_json::parse(request.config_json)};
}

int status_of(const experiment::RunOutcome& outcome) {
  if (outcome.completed()) return exit_completed;
  if (outcome.reason == rig::Reason::interrupt_signal) return exit_interrupted;
  if (outcome.reason == rig::Reason::terminate_signal) return exit_terminated;
  return exit_ended_early;
}

}  // namespace

int run(const RunRequest& request) {
  const settings::Settings& s = request.settings;
  const std::unique_ptr<driver::RigDriver> driver = make_driver(s);
  experiment::RunLogicParts logic = make_logic(s);
  RunOutputs outputs(request);
  runtime::MonotonicClock real_clock;
  runtime::VirtualClock virtual_clock;
  runtime::Clock& clock = request.outputs.fast ? static_cast<runtime::Clock&>(virtual_clock) : real_clock;
  experiment::RunSession session(clock, *driver, std::move(logic), s.gate, outputs.sinks());
  outputs.watch(session);
  note_signals();

  bool warned = request.outputs.fast || s.realtime.mode != runtime::RealtimeMode::prefer;
  const auto poll = [&] {
    if (!std::exchange(warned, true) && !session.realtime()) {
      spdlog::warn("NOT in real time: expect late cycles\n{}", session.outcome().realtime.failures());
    }
    outputs.poll();
    if (const rig::Reason signal = signalled(); signal != rig::Reason::none) return signal;
    return outputs.stop_requested() ? rig::Reason::stop_command : rig::Reason::none;
  };
  experiment::RunOutcome outcome;
  std::string lost;
  try {
    outcome = request.outputs.fast ? session.run_fast(poll) : session.run_realtime(s.realtime, poll);
  } catch (const telemetry::FileError& error) {
    // The run itself went on to its end: report it, and that its record is not whole.
    lost = error.what();
    outcome = session.outcome();
  }
  if (!outcome.ran) {
    throw driver::Unavailable("--rt require: real time is not to be had on this machine\n" +
                              outcome.realtime.failures());
  }
  const analysis::RunSummary summary = summarise(request, session, outcome, outputs);
  outputs.write(summary);
  fmt::print("{}", analysis::to_text(summary));
  if (!outcome.completed()) spdlog::error("run ended early: {}", summary.reason);
  if (!outcome.safe_state.ok()) {
    spdlog::error("the safe state may not have reached the board: {}", driver::description(outcome.safe_state.error));
  }
  if (!lost.empty()) {
    spdlog::error("recorded data was lost: {}", lost);
    return exit_ended_early;
  }
  return status_of(outcome);
}

}  // namespace abs_hil::app

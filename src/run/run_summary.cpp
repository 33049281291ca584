// The summary of a run as JSON, and whole runs in virtual time.
#include <fmt/format.h>

#include <cmath>
#include <span>
#include <string>

#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "config/merge.hpp"
#include "rig/reason_text.hpp"
#include "run/run.hpp"

namespace abs_hil::run {

namespace {

/// On a board a wheel that does what the identity calls impossible may also mean that the identity is wrong. In
/// simulation the plant is the identity.
std::string identity_hint(rig::Reason reason, const config::Settings& s) {
  if (!s.on_rig()) return {};
  const rig::RigParameters& rig = s.rig.parameters;
  const std::string tyre = fmt::format("rig.theta_N = {} N", rig.tyre.theta_N);
  const std::string motor = fmt::format("rig.motor_stall_torque_Nm = {} N m", rig.motor.stall_torque_Nm);
  const auto too = [](const std::string& values, const char* size, const char* change) {
    return fmt::format(
        "; if the encoders are sound, the rig's identity ({}) may be too {}: {} it in the rig's file (rig.identity) or "
        "with --set, and commission the board again",
        values, size, change);
  };
  switch (reason) {
    case rig::Reason::encoder_upper_stuck:
      return too(fmt::format("{}, rig.b1_Nm = {} N m", tyre, rig.brake.b1_Nm), "small", "raise");
    case rig::Reason::encoder_lower_stuck:
    case rig::Reason::encoder_upper_jumped: return too(tyre, "small", "raise");
    case rig::Reason::encoder_lower_jumped: return too(tyre + ", " + motor, "small", "raise");
    case rig::Reason::motor_no_response: return too(motor, "large", "lower");
    case rig::Reason::brake_no_response:
      return too(fmt::format("rig.b1_Nm = {} N m", rig.brake.b1_Nm), "large", "lower");
    default: return {};
  }
}

std::string reason_text(const RunOutcome& outcome, const config::Settings& s, std::span<const std::string> own_signals,
                        const nlohmann::ordered_json& foreign) {
  std::string text = rig::reason_text(outcome.reason, outcome.reason_value, own_signals);
  if (rig::is_fault(outcome.reason)) {
    std::string bound = config::number_text(s, rig::row_of(outcome.reason).value.bound);
    if (bound == "0") bound.clear();  // it stands for a default
    text = rig::reason_with_value(outcome.reason, outcome.reason_value, own_signals, bound) +
           identity_hint(outcome.reason, s);
  }
  if (outcome.reason == rig::Reason::controller_not_finite) {
    text += fmt::format(" (controller {})", s.control.controller);
    if (foreign.contains("failure")) text += ": " + foreign["failure"].get<std::string>();
  }
  if (!outcome.io_error.ok()) {
    text += ": " + driver::error_text(outcome.io_error);
  }
  return text;
}

/// Where the model differs from the plant; null on a rig, whose plant is unknown.
nlohmann::ordered_json differences_json(const config::Settings& s) {
  if (s.on_rig()) return nullptr;
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const config::ModelDifference& d : config::model_differences(s)) {
    json[d.name] = {{"model", d.model}, {"plant", d.plant}};
  }
  return json;
}

/// What the controller leaves for the next braking; null unless this one has stopped the car.
nlohmann::ordered_json learnt_json(const Run& run, const RunOutcome& outcome) {
  nlohmann::ordered_json json;
  if (rig::is_fault(outcome.reason) || std::isnan(run.metrics().metrics().stop_time_s)) return json;
  for (const control::Learnt& one : run.logic().controller().learnt()) json[one.key] = one.value;
  return json;
}

}  // namespace

analysis::RunSummary summarise(const Run& run, const RunOutcome& outcome,
                               const nlohmann::ordered_json& foreign_controller) {
  const config::Settings& s = run.settings();
  const std::string result = outcome.completed() ? "completed" : (rig::is_fault(outcome.reason) ? "fault" : "stopped");
  const runtime::CycleStatistics& statistics = run.executive().statistics();
  return {.result = result,
          .reason = reason_text(outcome, s, run.names().signals, foreign_controller),
          .controller = s.control.controller,
          .plant = s.plant_name,
          .backend = s.backend,
          .experiment = s.experiment.name,
          .metrics = run.metrics().metrics(),
          .cycles = statistics.cycles(),
          .telemetry_drops = run.record_drops(),
          .realtime = outcome.realtime.realtime(),
          .virtual_time = !run.real_time(),
          .truth_known = !s.on_rig(),
          .timing = run.real_time() ? statistics.summary() : rig::TimingSummary{},
          .gate = run.gate().counts(),
          .checks_unjudged = run.gate().unjudged_share(),
          .upper_eccentricity_rad = run.logic().learnt_discs().upper_rad,
          .lower_eccentricity_rad = run.logic().learnt_discs().lower_rad,
          .friction_curve = run.friction_curve() ? analysis::to_json(run.friction_curve()->result()) : nullptr,
          .model = s.model_name,
          .model_differences = differences_json(s),
          .model_note = config::in_words(config::model_differences(s)),
          .learnt = learnt_json(run, outcome),
          .foreign_controller = foreign_controller,
          .end_speed_m_s = s.experiment.end_speed_m_s};
}

void require_simulated(const config::Settings& s, const config::Script& script) {
  if (s.on_rig()) throw config::ConfigError("backend rig: only the simulated rig runs here; leave out the backend");
  if (s.experiment.wait_for_start) {
    throw config::ConfigError("experiment.wait_for_start: a run in virtual time cannot wait; leave it out");
  }
  if (script.series.given) {
    throw config::ConfigError("experiment " + script.name +
                              ": a series of runs, and this is one run; give an experiment without [series]");
  }
}

Simulation simulate(const config::Settings& s, const config::Script& script, const std::vector<rig::RecordSink*>& sinks,
                    const Run::Poll& poll) {
  require_simulated(s, script);
  const Prepared prepared(s, script);
  Run run(prepared);
  run.record_into(sinks);
  const RunOutcome outcome = run.go(poll);
  return {.names = run.names(), .summary = summarise(run, outcome)};
}

}  // namespace abs_hil::run

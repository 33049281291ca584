#include "program/run_results.hpp"

#include <fmt/format.h>

#include <span>
#include <string>

#include "config/key_table.hpp"
#include "config/model.hpp"
#include "rig/reason_text.hpp"

namespace abs_hil::program {

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

std::string reason_text(const experiment::RunOutcome& outcome, const config::Settings& s,
                        std::span<const std::string> own_signals, const nlohmann::ordered_json& foreign) {
  std::string text = rig::reason_text(outcome.reason, outcome.reason_value, own_signals);
  if (rig::is_fault(outcome.reason)) {
    const std::string bound = config::number_text(s, rig::row_of(outcome.reason).value.bound);
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

}  // namespace

analysis::RunSummary summarise(const RunRequest& request, const experiment::RunSession& session,
                               const experiment::RunOutcome& outcome, const RunResults& results) {
  const config::Settings& s = request.settings;
  const std::string result = outcome.completed() ? "completed" : (rig::is_fault(outcome.reason) ? "fault" : "stopped");
  return {.result = result,
          .reason = reason_text(outcome, s, results.names.signals, results.foreign_controller),
          .controller = s.control.controller,
          .plant = s.plant_name,
          .backend = s.backend,
          .experiment = s.experiment.name,
          .metrics = results.metrics,
          .cycles = session.executive().statistics().cycles(),
          .telemetry_drops = session.record_drops(),
          .publish_failures = results.publish_failures,
          .csv_rows_lost = results.csv_rows_lost,
          .realtime = outcome.realtime.realtime(),
          .virtual_time = request.outputs.fast,
          .truth_known = s.backend == "sim",
          .timing = request.outputs.fast ? rig::TimingSummary{} : session.executive().statistics().summary(),
          .gate = session.gate().counts(),
          .checks_unjudged = session.gate().unjudged_share(),
          .config = nlohmann::ordered_json::parse(request.config_json),
          .friction_curve = results.friction_curve,
          .model = s.model_name,
          .model_differences = differences_json(s),
          .model_note = config::in_words(config::model_differences(s)),
          .foreign_controller = results.foreign_controller,
          .end_speed_m_s = s.experiment.end_speed_m_s};
}

}  // namespace abs_hil::program

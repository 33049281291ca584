#include "program/run_results.hpp"

#include <fmt/format.h>

#include <span>
#include <string>

#include "config/key_table.hpp"
#include "config/model.hpp"
#include "rig/reason_text.hpp"

namespace abs_hil::program {

namespace {

std::string reason_text(const experiment::RunOutcome& outcome, const config::Settings& s,
                        std::span<const std::string> own_signals, const nlohmann::ordered_json& foreign) {
  std::string text = rig::reason_text(outcome.reason, outcome.reason_value, own_signals);
  if (rig::is_fault(outcome.reason)) {
    const std::string bound = config::number_text(s, rig::row_of(outcome.reason).value.bound);
    text = rig::reason_with_value(outcome.reason, outcome.reason_value, own_signals, bound);
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

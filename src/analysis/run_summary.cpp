// A run's summary as JSON and as lines of text.
#include "analysis/run_summary.hpp"

#include <fmt/format.h>

#include <cmath>

namespace abs_hil::analysis {

namespace {

nlohmann::ordered_json to_json(const rig::DurationQuantiles& q) {
  return {{"p50", number_or_null(q.p50_us)},
          {"p99", number_or_null(q.p99_us)},
          {"p99_9", number_or_null(q.p99_9_us)},
          {"max", number_or_null(q.max_us)}};
}

nlohmann::ordered_json by_cause(const rig::OverrunCounts& counts) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (std::size_t i = 1; i < rig::overrun_cause_count; ++i) {
    json[std::string(rig::name_of(static_cast<rig::OverrunCause>(i)))] = counts.by_cause[i];
  }
  return json;
}

nlohmann::ordered_json to_json(const rig::GateCounts& counts) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    json[std::string(rig::name_of(static_cast<rig::GateAction>(i)))] = counts[i];
  }
  return json;
}

/// "motor_rate_limited 3, refused 1"
std::string interventions_text(const rig::GateCounts& counts) {
  std::string text;
  for (std::size_t i = 1; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", rig::name_of(static_cast<rig::GateAction>(i)), counts[i]);
  }
  return text;
}

std::string shown(double value, int decimals, std::string_view unit) {
  return std::isfinite(value) ? fmt::format("{:.{}f}{}{}", value, decimals, unit.empty() ? "" : " ", unit) : "-";
}

template <typename Line>
void add_timing(const rig::TimingSummary& timing, const Line& line) {
  const auto quantiles = [](const rig::DurationQuantiles& q) {
    return fmt::format("p50 {:.0f}, p99 {:.0f}, p99.9 {:.0f}, max {:.0f} us", q.p50_us, q.p99_us, q.p99_9_us, q.max_us);
  };
  line("wake-up latency", quantiles(timing.wakeup_latency));
  line("read", quantiles(timing.read));
  line("control", quantiles(timing.control));
  line("write", quantiles(timing.write));
  line("cycle time", quantiles(timing.cycle_time));
  if (timing.overruns.total > 0) {
    std::string causes;
    for (std::size_t i = 1; i < rig::overrun_cause_count; ++i) {
      causes += fmt::format("{} {}, ", rig::name_of(static_cast<rig::OverrunCause>(i)), timing.overruns.by_cause[i]);
    }
    line("late because of", fmt::format("{}at most {} in a row, {} ticks missed", causes, timing.overruns.longest_run,
                                        timing.overruns.ticks_missed));
  }
}

}  // namespace

nlohmann::ordered_json to_json(const RunSummary& s) {
  const Metrics& m = s.metrics;
  nlohmann::ordered_json json{{"result", s.result}, {"reason", s.reason},   {"controller", s.controller},
                              {"plant", s.plant},   {"backend", s.backend}, {"experiment", s.experiment}};
  // Places count from 1 without a gap.
  for (std::size_t place = 1; place <= figures.size(); ++place) {
    for (const Figure& figure : figures) {
      if (figure.summary_place == static_cast<int>(place))
        json[std::string(figure.name)] = number_or_null(figure.of(m));
    }
  }
  json["truth_known"] = s.truth_known;
  json["cycles"] = s.cycles;
  json["overruns"] = s.timing.overruns.total;
  json["overruns_by_cause"] = by_cause(s.timing.overruns);
  json["overruns_startup"] = s.timing.overruns.startup;
  json["overruns_longest_run"] = s.timing.overruns.longest_run;
  json["ticks_missed"] = s.timing.overruns.ticks_missed;
  json["realtime"] = s.realtime;
  json["virtual_time"] = s.virtual_time;
  json["wakeup_latency_us"] = to_json(s.timing.wakeup_latency);
  json["read_us"] = to_json(s.timing.read);
  json["control_us"] = to_json(s.timing.control);
  json["write_us"] = to_json(s.timing.write);
  json["cycle_time_us"] = to_json(s.timing.cycle_time);
  json["telemetry_drops"] = s.telemetry_drops;
  json["publish_failures"] = s.publish_failures;
  json["csv_rows_lost"] = s.csv_rows_lost;
  json["gate"] = to_json(s.gate);
  json["checks_unjudged"] = number_or_null(s.checks_unjudged);
  json["encoder_eccentricity_rad"] = {{"upper", number_or_null(s.upper_eccentricity_rad)},
                                      {"lower", number_or_null(s.lower_eccentricity_rad)}};
  json["config"] = s.config;
  if (!s.friction_curve.is_null()) json["friction_curve"] = s.friction_curve;
  if (!s.learnt.is_null()) json["learnt"] = s.learnt;
  if (!s.foreign_controller.is_null()) json["foreign_controller"] = s.foreign_controller;
  json["model"] = s.model.empty() ? s.plant : s.model;
  json["model_differences"] = s.model_differences;
  json["missing"] = nlohmann::ordered_json::object();
  for (const MissingFigure& figure : missing_figures(m, s.end_speed_m_s)) {
    json["missing"][std::string(figure.name)] = figure.why;
  }
  return json;
}

std::string to_text(const RunSummary& s) {
  const Metrics& m = s.metrics;
  std::string text = fmt::format("{}: {}\n", s.result, s.reason);
  const auto line = [&text](std::string_view name, const std::string& value) {
    text += fmt::format("  {:<22}{}\n", name, value);
  };
  line("experiment",
       fmt::format("{}, controller {}, plant {}, backend {}", s.experiment, s.controller, s.plant, s.backend));
  if (!s.model_note.empty()) line("model", "differs from plant: " + s.model_note);
  line("braking started at", shown(m.brake_start_s, 3, "s"));
  line("stop time", shown(m.stop_time_s, 3, "s"));
  line("stop distance", shown(m.stop_distance_m, 2, "m"));
  for (const MissingFigure& figure : missing_figures(m, s.end_speed_m_s)) {
    if (figure.name == "stop_time_s") line("no stop", figure.why);
  }
  line("slip error",
       fmt::format("{} RMS, settled after {}", shown(m.slip_rms, 4, ""), shown(m.slip_settling_s, 3, "s")));
  line("theta estimate",
       std::isnan(m.theta_final_N) && m.final_speed_m_s > least_judged_speed_m_s
           ? fmt::format("- (the run ended at {:.3g} m/s)", m.final_speed_m_s)
           : fmt::format("{} at {:.0f} m/s, settled after {}", shown(m.theta_final_N, 2, "N"),
                         std::fmax(least_judged_speed_m_s, m.final_speed_m_s), shown(m.theta_settling_s, 3, "s")));
  if (!s.friction_curve.is_null()) {
    const auto value = [&s](const char* name) {
      return s.friction_curve[name].is_number() ? s.friction_curve[name].get<double>() : rig::unknown;
    };
    line("friction curve",
         fmt::format("peak {} at slip {}", shown(value("peak_force_N"), 2, "N"), shown(value("peak_slip"), 4, "")));
  }
  line("torque variation", shown(m.torque_total_variation_Nm, 1, "N m"));
  line("cycles", fmt::format("{}, {} overruns, {} records dropped, {} messages not sent", s.cycles,
                             s.timing.overruns.total, s.telemetry_drops, s.publish_failures));
  if (s.csv_rows_lost > 0) line("CSV rows lost", fmt::format("{}", s.csv_rows_lost));
  if (rig::interventions(s.gate) > 0) line("command gate", interventions_text(s.gate));
  if (s.checks_unjudged > 0.0) {
    line("checks of the wheels",
         fmt::format("a verdict was due and not possible yet for {:.3g} % of the time", 100.0 * s.checks_unjudged));
  }
  if (s.upper_eccentricity_rad > 0.0 || s.lower_eccentricity_rad > 0.0) {
    line("encoder discs", fmt::format("off their centres, upper {} and lower {}: learnt before braking, and corrected",
                                      shown(1e3 * s.upper_eccentricity_rad, 2, "mrad"),
                                      shown(1e3 * s.lower_eccentricity_rad, 2, "mrad")));
  }
  if (s.virtual_time) {
    line("timing", "virtual time (--fast): no latencies to report");
  } else {
    add_timing(s.timing, line);
    if (!s.realtime) line("real time", "NOT obtained: expect late cycles");
  }
  if (!s.foreign_controller.is_null() && !s.virtual_time) {
    const nlohmann::ordered_json& steps = s.foreign_controller["step_us"];
    line("controller's steps",
         fmt::format("p50 {:.0f}, p99 {:.0f}, p99.9 {:.0f}, max {:.0f} us", steps["p50"].get<double>(),
                     steps["p99"].get<double>(), steps["p99_9"].get<double>(), steps["max"].get<double>()));
  }
  if (!s.truth_known) line("note", "speeds and slip are estimates: this backend has no true values");
  return text;
}

}  // namespace abs_hil::analysis

// An experiment in words, as `abs_hil validate` prints it, and a plant's file to be filled in.
#include <fmt/format.h>

#include <cmath>

#include "config/key_table.hpp"
#include "config/plan.hpp"

namespace abs_hil::config {

namespace {

using experiment::BrakeAction;
using experiment::EndKind;

std::string number(double value) { return fmt::format("{:.6g}", value); }

std::string in_words(const experiment::Profile& profile, std::string_view unit) {
  constexpr std::size_t longest = 120;
  const auto& points = profile.points();
  std::string text = fmt::format("{}{}", number(points.front().value), unit);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const auto& before = points[i - 1];
    const auto& point = points[i];
    if (point.value == before.value) continue;
    const bool step = profile.between() == experiment::Between::hold || point.time_s == before.time_s;
    text += step ? fmt::format(", from {} s on ", number(point.time_s))
                 : fmt::format(", from {} s to {} s {} to ", number(before.time_s), number(point.time_s),
                               point.value > before.value ? "rising" : "falling");
    text += fmt::format("{}{}", number(point.value), unit);
    if (text.size() > longest) return fmt::format("{}, ... ({} points)", text, points.size());
  }
  return text;
}

std::string in_words(const experiment::EndCondition& end) {
  std::string text = fmt::format(fmt::runtime(experiment::row_of(end.kind).in_words), number(end.value));
  if (end.reason == rig::Reason::slip_control_left_at_low_speed) text += " (least speed for slip control)";
  for (const experiment::EndCondition& part : end.parts) text += (text.empty() ? "" : " and ") + in_words(part);
  return text;
}

/// @param goes_on  the phase before used the controller too, and this one does not restart it
std::string brake_in_words(const experiment::PhasePlan& phase, const Settings& s, bool goes_on) {
  switch (phase.brake) {
    case BrakeAction::released: return "off";
    case BrakeAction::torque: return "torque " + in_words(phase.brake_torque_Nm, " N m");
    case BrakeAction::duty: return "duty " + in_words(phase.brake_duty, "");
    case BrakeAction::slip_control: break;
  }
  return fmt::format("controller {}{}, slip reference {}", s.control.controller, goes_on ? " (goes on)" : "",
                     phase.slip_ref.empty() ? number(s.control.slip_ref) : in_words(phase.slip_ref, ""));
}

void add_series(const Script& script, const Settings& s, std::string& text) {
  const SeriesScript& series = script.series;
  if (!series.given) return;
  const std::vector<SeriesMember> members = members_of(script, s.seed);
  std::string varied;
  if (!series.experiments.empty()) varied = fmt::format("  experiment.name: {}\n", fmt::join(series.experiments, ", "));
  for (const Factor& factor : script.factors) {
    std::vector<std::string> values;
    for (const Value& value : std::get<Levels>(factor.values).values) values.push_back(text_of(value));
    varied += fmt::format("  {}: {}\n", factor.key, fmt::join(values, ", "));
  }
  const std::string seeds =
      series.seeds.empty() ? fmt::format("{} of each with seeds from {}", series.repeat, series.seed.value_or(s.seed))
                           : fmt::format("with the seeds {}", fmt::join(series.seeds, ", "));
  text += fmt::format("Series of {} runs, {}, in real time {} s apart\n{}", members.size(), seeds,
                      number(series.pause_s), varied);
}

std::string facts_of(const Key& key) {
  const bool is_number =
      std::holds_alternative<double*>(key.target) || std::holds_alternative<std::int32_t*>(key.target);
  std::string text = fmt::format("# {}", key.meaning);
  if (is_number) text += fmt::format("; {}{}{}", key.range.text(), key.unit.empty() ? "" : " ", key.unit);
  if (!key.allowed.empty()) text += fmt::format("; {}", fmt::join(key.allowed.list(), ", "));
  return text + '\n';
}

/// The keys of the rig's parameters, or those of the simulation only.
std::string section(const KeyTable& keys, bool of_rig) {
  constexpr std::string_view prefix = "plant.";
  std::string text;
  for (const Key& key : keys.keys()) {
    if (!key.name.starts_with(prefix) || key.on_rig.empty() == of_rig) continue;
    text += '\n' + facts_of(key);
    if (of_rig) text += fmt::format("# on the rig: {}\n", key.on_rig);
    text += fmt::format("{} = {}\n", key.name.substr(prefix.size()), toml_of(value_of(key)));
  }
  return text;
}

}  // namespace

std::string explain(const Script& script, const Settings& settings) {
  Settings s = settings;
  apply(script, s);
  std::string text =
      fmt::format("{}: {}\n", script.name, script.description.empty() ? "no description" : script.description);
  if (!script.series.experiments.empty()) {
    add_series(script, s, text);
    return text;
  }
  const Plan plan = abs_hil::config::plan(script, s);
  for (std::size_t i = 0; i < plan.phases.size(); ++i) {
    const experiment::PhasePlan& phase = plan.phases[i];
    const bool goes_on = i > 0 && plan.phases[i - 1].brake == BrakeAction::slip_control && !phase.restart;
    std::string ends;
    for (const experiment::EndCondition& end : phase.ends_on) ends += (ends.empty() ? "" : ", or ") + in_words(end);
    if (!phase.question.empty()) ends = fmt::format("a person has answered: \"{}\"", phase.question);
    text += fmt::format("{}. {} ({}): {}motor {}, brake {}\n   until {}; a fault after {} s\n", i + 1, phase.name,
                        rig::name_of(phase.phase), phase.wheels_apart ? "wheels apart, " : "",
                        phase.motor_duty.zero() ? "off" : "duty " + in_words(phase.motor_duty, ""),
                        brake_in_words(phase, s, goes_on), ends, number(phase.time_limit_s));
  }
  text += fmt::format("Limits: wheels {} rad/s, motor duty {}, brake duty {}", number(s.gate.overspeed_rad_s),
                      number(s.gate.motor_duty_max), number(s.gate.brake_duty_max));
  if (std::isfinite(plan.limits.run_time_s)) text += fmt::format(", run {} s", number(plan.limits.run_time_s));
  if (std::isfinite(plan.limits.distance_m)) text += fmt::format(", distance {} m", number(plan.limits.distance_m));
  text += '\n';
  for (const ChangingPart& part : changing_parts()) {
    const std::string& profile = part.profile(s);
    if (!profile.empty()) text += fmt::format("Simulation only: {}, a factor over {}\n", part.in_words, profile);
  }
  if (!s.inject.empty()) text += fmt::format("Faults (never on hardware): {}\n", s.inject);
  for (const Setting& setting : script.settings) {
    text += fmt::format("Setting: {} = {}\n", setting.key, text_of(setting.value));
  }
  if (!script.analysis.empty()) text += fmt::format("Analysis: {}\n", script.analysis);
  add_series(script, s, text);
  return text;
}

std::string rig_file(const Settings& settings, std::string_view name) {
  Settings copy = settings;
  const KeyTable keys(copy);
  return fmt::format(
             "# The rig {0}. Replace the values by those of your rig; until then they are those of {1}.\n"
             "#   abs_hil --plant {0}.toml                         simulates it\n"
             "#   abs_hil commission --set rig.identity={0}.toml   tries the rig out; each run needs both options:\n"
             "#   abs_hil --backend rig --set rig.identity={0}.toml --model {0}.toml   limits, and what to believe\n"
             "description = \"the rig {0}\"\n\n[plant]\n"
             "# ---- read off the rig",
             name, settings.plant_name) +
         '\n' + section(keys, true).substr(1) + "\n# ---- of the simulation only\n" + section(keys, false);
}

}  // namespace abs_hil::config

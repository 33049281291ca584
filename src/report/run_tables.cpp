#include "report/run_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>

#include "report/metric_list.hpp"
#include "report/table.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

/// With more runs than this, runs become rows instead of columns.
constexpr std::size_t most_columns = 5;
constexpr std::size_t most_events = 200;

std::vector<std::string> header_of(const std::vector<RunFiles>& runs, const std::string& first = "") {
  std::vector<std::string> header{first};
  for (const RunFiles& run : runs) header.push_back(run.label);
  return header;
}

std::string arranged(const Table& table, std::size_t runs) {
  return runs > most_columns ? table.turned().html() : table.html();
}

std::string text_or_dash(const std::string& text) { return text.empty() ? "–" : text; }

/// Change from the first to the second run, in per cent; a large change as a factor.
std::string change(double first, double second) {
  constexpr double large = 3.0;
  if (!std::isfinite(first) || !std::isfinite(second) || first == 0.0) return "–";
  if (second / first >= large) return fmt::format("× {}", shown_significant(second / first, 3));
  return fmt::format("{}{} %", second > first ? "+" : "", shown(100.0 * (second / first - 1.0), 1));
}

std::string count_of(const RunFiles& run, const std::string& key) {
  const double count = run.number(key);
  return std::isfinite(count) ? fmt::format("{:.0f}", count) : "–";
}

/// Where the controllers' model differs from the simulated plant, as in the run's summary. The configuration holds only
/// the values of the model that were set.
std::string model_note(const RunFiles& run) {
  constexpr std::string_view prefix = "model.";
  std::string note;
  for (const auto& [key, value] : run.config) {
    if (!key.starts_with(prefix)) continue;
    const std::string name = key.substr(prefix.size());
    const auto plant = run.config.find("plant." + name);
    if (plant == run.config.end() || plant->second == value) continue;
    note += fmt::format("{}{} {} (plant {})", note.empty() ? "" : ", ", name, value, plant->second);
  }
  return note;
}

/// Changes of phase, for a run folder without events.
std::vector<RunEvent> events_of(const RunFiles& run, const RunSurvey& survey) {
  if (!run.events.empty()) return run.events;
  std::vector<RunEvent> events;
  events.reserve(survey.phases.size());
  for (const PhaseInterval& phase : survey.phases) {
    events.push_back({phase.from_s, phase.phase == "fault" ? "fault" : "phase", phase.phase, "", ""});
  }
  if (!events.empty() && events.back().event == "fault") events.back().reason = run.text("reason");
  return events;
}

}  // namespace

std::string metrics_table(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys) {
  Table table{"metrics", header_of(runs), {}, true};
  const bool pair = runs.size() == 2;
  std::string shared;  // values that all of many runs share are shown once
  if (pair) table.header.emplace_back("second relative to first");
  for (const auto& [key, name] : std::array<std::pair<const char*, const char*>, 6>{{{"result", "result"},
                                                                                     {"reason", "reason"},
                                                                                     {"experiment", "experiment"},
                                                                                     {"controller", "controller"},
                                                                                     {"plant", "plant"},
                                                                                     {"backend", "backend"}}}) {
    std::vector<std::string> row{name};
    for (const RunFiles& run : runs) row.push_back(text_or_dash(run.text(key)));
    if (std::all_of(row.begin() + 1, row.end(), [](const std::string& cell) { return cell == "–"; })) continue;
    if (runs.size() > most_columns &&
        std::adjacent_find(row.begin() + 1, row.end(), std::not_equal_to<>()) == row.end()) {
      shared += fmt::format("{}{}: {}", shared.empty() ? "" : "; ", name, row[1]);
      continue;
    }
    if (pair) row.emplace_back();
    table.rows.push_back(std::move(row));
  }
  std::vector<std::string> models{"model differs from plant"};
  for (const RunFiles& run : runs) models.push_back(text_or_dash(model_note(run)));
  if (pair) models.emplace_back();
  const bool differ = std::any_of(runs.begin(), runs.end(), [](const auto& run) { return !model_note(run).empty(); });
  if (differ) table.rows.push_back(std::move(models));
  std::vector<std::string> truth{"speeds and slip"};
  for (const RunSurvey& survey : surveys) truth.emplace_back(survey.knows("omega2_rad_s") ? "truth" : "estimates");
  if (pair) truth.emplace_back();
  table.rows.push_back(std::move(truth));
  for (const Metric& m : metrics()) {
    std::vector<std::string> row{std::string(m.name)};
    std::vector<double> values;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      values.push_back(value_of(m, runs[r], surveys[r]));
      row.push_back(shown(values.back(), m.decimals));
    }
    if (std::none_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); })) continue;
    const bool comparable = m.key != "brake_start_s" && m.key != "theta_error_final";
    if (pair) row.push_back(comparable ? change(values[0], values[1]) : "");
    table.rows.push_back(std::move(row));
  }
  std::vector<std::string> rows{"rows in the CSV"};
  for (const RunSurvey& survey : surveys) rows.push_back(fmt::format("{}", survey.rows));
  if (pair) rows.emplace_back();
  table.rows.push_back(std::move(rows));
  return (shared.empty() ? "" : fmt::format("<p>All runs: {}.</p>\n", html_escape(shared))) +
         arranged(table, runs.size());
}

std::string timing_table(const std::vector<RunFiles>& runs) {
  static constexpr std::array<std::pair<const char*, const char*>, 5> parts{{{"wakeup_latency_us", "wake-up latency"},
                                                                             {"read_us", "read"},
                                                                             {"control_us", "control"},
                                                                             {"write_us", "write"},
                                                                             {"cycle_time_us", "whole cycle"}}};
  static constexpr std::array<std::pair<const char*, const char*>, 4> quantiles{
      {{"p50", "median"}, {"p99", "99 %"}, {"p99_9", "99.9 %"}, {"max", "greatest"}}};
  std::vector<RunFiles> timed;
  std::copy_if(runs.begin(), runs.end(), std::back_inserter(timed),
               [](const RunFiles& run) { return std::isfinite(run.number("cycle_time_us.p50")); });
  if (timed.empty()) return {};
  Table table{"timing", header_of(timed, "µs"), {}, true};
  for (const auto& [key, part] : parts) {
    for (const auto& [quantile, name] : quantiles) {
      std::vector<std::string> row{fmt::format("{}, {}", part, name)};
      for (const RunFiles& run : timed) row.push_back(shown(run.number(fmt::format("{}.{}", key, quantile)), 0));
      table.rows.push_back(std::move(row));
    }
  }
  const auto add = [&](const std::string& name, const std::string& key) {
    std::vector<std::string> row{name};
    for (const RunFiles& run : timed) row.push_back(count_of(run, key));
    table.rows.push_back(std::move(row));
  };
  add("cycles", "cycles");
  add("late cycles", "overruns");
  add("late at start-up", "overruns_startup");
  add("longest run of late cycles", "overruns_longest_run");
  add("ticks missed", "ticks_missed");
  add("records lost", "telemetry_drops");
  std::vector<std::string> unjudged{"verdict on the wheels overdue, % of the time"};
  constexpr double percent = 100.0;
  for (const RunFiles& run : timed) unjudged.push_back(shown(percent * run.number("checks_unjudged"), 1));
  table.rows.push_back(std::move(unjudged));
  std::vector<std::string> realtime{"real time obtained"};
  for (const RunFiles& run : timed) {
    realtime.emplace_back(run.summary.value("realtime", nlohmann::ordered_json(false)) == true ? "yes" : "no");
  }
  table.rows.push_back(std::move(realtime));
  return arranged(table, timed.size());
}

std::string differences_table(const std::vector<RunFiles>& runs) {
  const std::vector<std::string> keys = differing_keys(runs);
  if (keys.empty()) return {};
  Table table{"differences", header_of(runs, "key"), {}, false};
  for (const std::string& key : keys) {
    std::vector<std::string> row{key};
    for (const RunFiles& run : runs) {
      const auto found = run.config.find(key);
      row.push_back(found == run.config.end() ? "–" : found->second);
    }
    table.rows.push_back(std::move(row));
  }
  return arranged(table, runs.size());
}

std::string events_table(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys) {
  Table table{"events", {"time / s", "run", "event", "phase", "reason", "value"}, {}, false};
  std::size_t left_out = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const RunEvent& event : events_of(runs[r], surveys[r])) {
      if (table.rows.size() == most_events) {
        ++left_out;
        continue;
      }
      table.rows.push_back({shown(event.time_s, 3), runs[r].name, event.event, event.phase, event.reason, event.value});
    }
  }
  if (table.rows.empty()) return {};
  return table.html() + (left_out > 0 ? fmt::format("<p>{} more events are not shown.</p>\n", left_out) : "");
}

std::string environment_table(const std::vector<RunFiles>& runs) {
  std::set<std::string> keys;
  for (const RunFiles& run : runs) {
    for (const auto& entry : run.environment) keys.insert(entry.first);
  }
  if (keys.empty()) return {};
  Table table{"environment", header_of(runs), {}, false};
  for (const std::string& key : keys) {
    std::vector<std::string> row{key};
    for (const RunFiles& run : runs) {
      const auto found = run.environment.find(key);
      row.push_back(found == run.environment.end() ? "–" : found->second);
    }
    table.rows.push_back(std::move(row));
  }
  return arranged(table, runs.size());
}

std::vector<std::string> all_notes(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys,
                                   const std::vector<std::string>& general) {
  std::vector<std::string> notes = general;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const auto add = [&](const std::string& note) { notes.push_back(runs[r].name + ": " + note); };
    for (const std::string& note : runs[r].notes) add(note);
    if (surveys[r].truncated) add("the last row of the CSV is incomplete, as after a crash, and is left out");
    for (const std::string& note : contradictions(runs[r], surveys[r])) add(note);
  }
  return notes;
}

std::string notes_list(const std::vector<std::string>& notes) {
  std::string items;
  for (const std::string& note : notes) items += fmt::format("<li>{}</li>\n", html_escape(note));
  return items.empty() ? "" : "<ul id=\"notes\">\n" + items + "</ul>\n";
}

}  // namespace abs_hil::report

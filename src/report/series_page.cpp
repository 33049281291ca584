#include "report/series_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include "analysis/statistics.hpp"
#include "report/axis.hpp"
#include "report/metric_list.hpp"
#include "report/table.hpp"
#include "report/text.hpp"

namespace abs_hil::report {

namespace {

constexpr std::size_t most_keys_in_label = 3;
constexpr std::size_t label_characters = 36;
constexpr std::size_t most_tics = 12;
constexpr std::array<std::string_view, 4> shown_metrics{"stop_time_s", "stop_distance_m", "slip_rms",
                                                        "torque_total_variation_Nm"};
constexpr std::array<std::string_view, 4> shown_labels{"stop time / s", "distance / m", "slip RMS error",
                                                       "torque var. / (N m)"};

std::optional<double> number_of(const std::string& text) {
  double value = 0.0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  if (parsed.ec != std::errc{} || parsed.ptr != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string last_part(const std::string& key) { return key.substr(key.rfind('.') + 1); }

std::string value_in(const RunFiles& run, const std::string& key) {
  const auto found = run.config.find(key);
  return found == run.config.end() ? "–" : found->second;
}

std::string label_of(const RunFiles& run, const std::vector<std::string>& keys) {
  std::string label;
  for (std::size_t i = 0; i < std::min(keys.size(), most_keys_in_label); ++i) {
    label += fmt::format("{}{} = {}", i > 0 ? ", " : "", last_part(keys[i]), value_in(run, keys[i]));
  }
  if (keys.size() > most_keys_in_label) label += ", …";
  return label.empty() ? "all runs" : clean_text(label, label_characters);
}

std::vector<double> values_of(const Metric& m, const SeriesGroup& group, const std::vector<RunFiles>& runs,
                              const std::vector<RunSurvey>& surveys) {
  std::vector<double> values;
  values.reserve(group.runs.size());
  for (const std::size_t r : group.runs) values.push_back(value_of(m, runs[r], surveys[r]));
  return values;
}

/// Positions of the groups on the x axis: their values, if these are different numbers, else 1, 2, 3, ...
std::vector<double> places_of(const SeriesStudy& study) {
  std::vector<double> places;
  places.reserve(study.groups.size());
  const bool by_value = study.keys.size() == 1 && study.groups.size() > 1 &&
                        std::all_of(study.groups.begin(), study.groups.end(), [](const auto& g) { return g.value; });
  for (std::size_t g = 0; g < study.groups.size(); ++g) {
    places.push_back(by_value ? study.groups[g].value.value_or(0.0) : static_cast<double>(g + 1));
  }
  return places;
}

}  // namespace

SeriesStudy study(const Series& series, const std::vector<RunFiles>& runs) {
  SeriesStudy study;
  std::vector<RunFiles> own;
  own.reserve(series.runs.size());
  for (const std::size_t r : series.runs) own.push_back(runs[r]);
  for (const std::string& key : differing_keys(own)) {
    if (key != "run.seed") study.keys.push_back(key);  // the seed varies too, but is not the studied quantity
  }
  std::map<std::vector<std::string>, std::size_t> known;
  for (const std::size_t r : series.runs) {
    std::vector<std::string> values;
    values.reserve(study.keys.size());
    for (const std::string& key : study.keys) values.push_back(value_in(runs[r], key));
    const auto [entry, is_new] = known.emplace(values, study.groups.size());
    if (is_new) {
      study.groups.push_back(
          {label_of(runs[r], study.keys), {}, values.empty() ? std::nullopt : number_of(values.front())});
    }
    study.groups[entry->second].runs.push_back(r);
  }
  std::stable_sort(study.groups.begin(), study.groups.end(), [](const SeriesGroup& a, const SeriesGroup& b) {
    return a.value && b.value && *a.value < *b.value;
  });
  return study;
}

std::string series_table(const SeriesStudy& study, const std::vector<RunFiles>& runs,
                         const std::vector<RunSurvey>& surveys) {
  std::string varied;
  for (const std::string& key : study.keys) varied += (varied.empty() ? "" : ", ") + key;
  Table table{"series", {"figure", varied.empty() ? "only the seed varies" : varied}, {}, true};
  for (const char* column : {"runs", "mean", "standard deviation", "95 % interval of the mean"}) {
    table.header.emplace_back(column);
  }
  for (const Metric& m : metrics()) {
    if (m.key == "brake_start_s") continue;
    for (const SeriesGroup& group : study.groups) {
      const analysis::Estimate e = analysis::estimate_mean(values_of(m, group, runs, surveys));
      if (e.n == 0) continue;
      table.rows.push_back(
          {std::string(m.name), group.label, fmt::format("{}", e.n), shown(e.mean, m.decimals + 1),
           shown(e.standard_deviation, m.decimals + 1),
           e.n < 2 ? "–" : fmt::format("{} to {}", shown(e.low, m.decimals + 1), shown(e.high, m.decimals + 1))});
    }
  }
  return table.html();
}

Figure series_figure(const std::string& id, const SeriesStudy& study, const std::vector<RunFiles>& runs,
                     const std::vector<RunSurvey>& surveys) {
  Figure figure;
  figure.id = id;
  figure.heading = "Figures of merit over the varied keys";
  const std::vector<double> places = places_of(study);
  const bool by_value = study.groups.size() > 1 && study.keys.size() == 1 && study.groups.front().value;
  // Configuration keys contain dots and underscores; enhanced text would set subscripts.
  std::string key = by_value ? study.keys.front() : "group";
  for (std::size_t at = key.find('_'); at != std::string::npos; at = key.find('_', at + 2)) key.insert(at, "\\");
  figure.x_label = key;
  const auto [low, high] = std::minmax_element(places.begin(), places.end());
  const double room = *high > *low ? 0.06 * (*high - *low) : 0.5;
  figure.x_range = Range{*low - room, *high + room};
  const double beside = 0.012 * (figure.x_range->second - figure.x_range->first);
  const Style run_marks{"#0072B2", "solid", 1.0, 6};
  const Style mean_marks{"#000000", "solid", 1.2, 7};
  for (std::size_t i = 0; i < shown_metrics.size(); ++i) {
    const Metric& m = metric(shown_metrics[i]);
    Panel panel{.y_label = std::string(shown_labels[i]), .height_px = 120.0};
    Curve every{0, std::string(m.key), run_marks, {}, Drawn::markers, {}};
    Curve means{0, fmt::format("mean of {}", m.key), mean_marks, {}, Drawn::intervals, {}};
    for (std::size_t g = 0; g < study.groups.size(); ++g) {
      const std::vector<double> values = values_of(m, study.groups[g], runs, surveys);
      for (const double value : values) {
        if (std::isfinite(value)) every.points.push_back({places[g] + beside, value});
      }
      const analysis::Estimate e = analysis::estimate_mean(values);
      if (e.n < 2) continue;
      means.points.push_back({places[g], e.mean});
      means.bounds.emplace_back(e.low, e.high);
    }
    if (every.points.empty()) continue;
    if (!means.points.empty()) panel.curves.push_back(std::move(means));
    panel.curves.push_back(std::move(every));
    for (std::size_t g = 0; !by_value && g < study.groups.size() && study.groups.size() <= most_tics; ++g) {
      panel.x_tics.emplace_back(places[g], fmt::format("{}", g + 1));
    }
    figure.panels.push_back(std::move(panel));
  }
  figure.legend = {{"runs", run_marks, Drawn::markers}, {"mean, 95 % interval", mean_marks, Drawn::intervals}};
  figure.caption =
      "Circles: runs, drawn a little to the right; dots with bars: mean of the runs with the same values and its 95 % "
      "confidence interval.";
  if (!by_value) {
    std::string groups;
    for (std::size_t g = 0; g < study.groups.size() && g < most_tics; ++g) {
      groups += fmt::format("{}{}: {}", g > 0 ? "; " : " Groups: ", g + 1, study.groups[g].label);
    }
    figure.caption += groups + ".";
  }
  return figure;
}

}  // namespace abs_hil::report

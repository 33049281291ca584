#include "study/comparison_table.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "config/model.hpp"

namespace abs_hil::study {

namespace {

using analysis::Better, analysis::Figure, analysis::Metrics;

/// A metric of every run, in order; NaN for runs that ended by a fault.
std::vector<double> values_of(const std::vector<RunResult>& runs, double Metrics::*value, bool magnitude = false) {
  std::vector<double> values;
  values.reserve(runs.size());
  for (const RunResult& run : runs) {
    const double found = run.stopped() ? run.metrics.*value : rig::unknown;
    values.push_back(magnitude ? std::abs(found) : found);
  }
  return values;
}

std::vector<double> values_of(const std::vector<RunResult>& runs, const Figure& figure) {
  return values_of(runs, figure.value, figure.better == Better::nearer_zero);
}

ControllerColumn column_of(const Contender& contender, const std::vector<RunResult>& runs,
                           const std::vector<RunResult>* first) {
  const auto count = [&runs](auto&& holds) {
    return static_cast<std::size_t>(std::count_if(runs.begin(), runs.end(), holds));
  };
  ControllerColumn column{.name = contender.name,
                          .controller = contender.settings.control.controller,
                          .changes = contender.changes,
                          .runs = runs.size(),
                          .faults = count([](const RunResult& run) { return !run.stopped(); }),
                          .locked = count([](const RunResult& run) { return run.metrics.time_locked_s > 0.0; })};
  for (const Figure& metric : compared_metrics()) {
    const std::vector<double> values = values_of(runs, metric);
    column.means.push_back(analysis::estimate_mean(values));
    column.spreads.push_back({.p10 = analysis::quantile(values, 0.1),
                              .median = analysis::quantile(values, 0.5),
                              .p90 = analysis::quantile(values, 0.9)});
    if (first != nullptr) {
      column.differences.push_back(analysis::estimate_difference(values, values_of(*first, metric)));
    }
  }
  return column;
}

std::optional<PaperRatio> paper_ratio(const Comparison& comparison) {
  const auto runs_of = [&](std::string_view name) -> const std::vector<RunResult>* {
    for (std::size_t c = 0; c < comparison.contenders.size(); ++c) {
      if (comparison.contenders[c].name == name) return &comparison.results[c];
    }
    return nullptr;
  };
  const auto* ours = runs_of("adaptive");
  const auto* theirs = runs_of("sliding-mode");
  if (ours == nullptr || theirs == nullptr) return std::nullopt;
  const auto ratio = [&](double Metrics::*value) {
    return analysis::estimate_ratio(values_of(*ours, value), values_of(*theirs, value));
  };
  return PaperRatio{.stop_time = ratio(&Metrics::stop_time_s),
                    .stop_distance = ratio(&Metrics::stop_distance_m),
                    .slip_rms = ratio(&Metrics::slip_rms),
                    .torque_total_variation = ratio(&Metrics::torque_total_variation_Nm)};
}

}  // namespace

const std::vector<Figure>& compared_metrics() {
  static const std::vector<Figure> compared = [] {
    std::vector<Figure> rows;
    std::copy_if(analysis::figures.begin(), analysis::figures.end(), std::back_inserter(rows),
                 [](const Figure& figure) { return figure.compared; });
    return rows;
  }();
  return compared;
}

ComparisonTable tabulate(const ComparisonPlan& plan, const Comparison& comparison) {
  ComparisonTable table{.plant = plan.settings.plant_name,
                        .experiment = plan.settings.experiment.name,
                        .start_speed_rad_s = plan.settings.experiment.start_speed_rad_s,
                        .end_speed_m_s = plan.settings.experiment.end_speed_m_s,
                        .slip_ref = plan.settings.control.slip_ref,
                        .repeat = plan.repeat,
                        .seed = plan.seed,
                        .variation = plan.variation,
                        .model_note = config::in_words(config::model_differences(plan.settings))};
  const std::vector<RunResult>* first = nullptr;
  for (std::size_t c = 0; c < comparison.contenders.size(); ++c) {
    table.columns.push_back(column_of(comparison.contenders[c], comparison.results[c], first));
    if (first == nullptr) first = &comparison.results[c];
  }
  table.paper_ratio = paper_ratio(comparison);
  return table;
}

}  // namespace abs_hil::study

#include "study/comparison_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "config/model.hpp"

namespace abs_hil::study {

namespace {

using analysis::Metrics;

constexpr std::array<ComparedMetric, 10> all_metrics{{
    {"stop_time_s", "stop time", "s", 3, &Metrics::stop_time_s},
    {"stop_distance_m", "stop distance", "m", 2, &Metrics::stop_distance_m},
    {"slip_rms", "slip RMS error", "", 4, &Metrics::slip_rms},
    {"slip_settling_s", "slip settling", "s", 3, &Metrics::slip_settling_s},
    {"slip_overshoot", "slip overshoot", "", 4, &Metrics::slip_overshoot},
    {"time_locked_s", "time locked", "s", 3, &Metrics::time_locked_s},
    {"torque_total_variation_Nm", "torque variation", "N m", 1, &Metrics::torque_total_variation_Nm},
    {"theta_settling_s", "theta settling", "s", 3, &Metrics::theta_settling_s},
    {"theta_error_rms", "theta RMS error", "", 4, &Metrics::theta_error_rms},
    {"theta_error_final", "theta error at end", "", 4, &Metrics::theta_error_final, true},
}};

/// A metric of every run, in order; NaN for runs that ended by a fault.
std::vector<double> values_of(const std::vector<RunResult>& runs, const ComparedMetric& metric) {
  std::vector<double> values;
  values.reserve(runs.size());
  for (const RunResult& run : runs) {
    const double value = run.metrics.*metric.value;
    values.push_back(run.stopped() ? (metric.magnitude ? std::abs(value) : value) : rig::unknown);
  }
  return values;
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
  for (const ComparedMetric& metric : all_metrics) {
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
    const ComparedMetric metric{.key = {}, .title = {}, .unit = {}, .value = value};
    return analysis::estimate_ratio(values_of(*ours, metric), values_of(*theirs, metric));
  };
  return PaperRatio{.stop_time = ratio(&Metrics::stop_time_s),
                    .stop_distance = ratio(&Metrics::stop_distance_m),
                    .slip_rms = ratio(&Metrics::slip_rms),
                    .torque_total_variation = ratio(&Metrics::torque_total_variation_Nm)};
}

}  // namespace

std::span<const ComparedMetric> compared_metrics() noexcept { return all_metrics; }

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

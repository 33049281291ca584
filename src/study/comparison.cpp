// The runs of a comparison and the statistics of each controller.
#include "study/comparison.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "study/runs.hpp"

namespace abs_hil::study {

namespace {

using analysis::Better, analysis::Figure, analysis::Metrics;

/// A metric of every run, in order; NaN for runs that ended by a fault. Of one that should be near zero the size
/// counts: errors of both signs must not cancel.
std::vector<double> values_of(const std::vector<RunResult>& runs, double Metrics::*metric, bool magnitude = false) {
  std::vector<double> values;
  values.reserve(runs.size());
  for (const RunResult& run : runs) {
    const double value = run.metrics.*metric;
    values.push_back(run.stopped() ? (magnitude ? std::abs(value) : value) : rig::unknown);
  }
  return values;
}

std::vector<double> values_of(const std::vector<RunResult>& runs, const Figure& figure) {
  return values_of(runs, figure.value, figure.better == Better::nearer_zero);
}

ControllerColumn column_of(const std::vector<RunResult>& runs, const std::vector<RunResult>* first) {
  const auto count = [&runs](auto&& holds) { return static_cast<std::size_t>(std::ranges::count_if(runs, holds)); };
  ControllerColumn column{.runs = runs.size(),
                          .faults = count([](const RunResult& run) { return !run.stopped(); }),
                          .locked = count([](const RunResult& run) { return run.metrics.time_locked_s > 0.0; })};
  for (const Figure& metric : compared_metrics()) {
    const std::vector<double> values = values_of(runs, metric);
    column.means.push_back(analysis::estimate_mean(values));
    column.spreads.push_back({.p10 = analysis::quantile(values, 0.1),
                              .median = analysis::quantile(values, 0.5),
                              .p90 = analysis::quantile(values, 0.9)});
    if (first == nullptr) continue;
    column.differences.push_back(analysis::estimate_difference(values, values_of(*first, metric)));
  }
  return column;
}

}  // namespace

const std::vector<Figure>& compared_metrics() {
  static const std::vector<Figure> compared = [] {
    std::vector<Figure> rows;
    std::ranges::copy_if(analysis::figures, std::back_inserter(rows), &Figure::compared);
    return rows;
  }();
  return compared;
}

RunsByController run_by_controller(const Study& study, std::size_t threads,
                                   const std::function<void(std::size_t)>& done) {
  const std::size_t controllers = study.contenders(0).size();
  RunsByController runs(controllers, std::vector<RunResult>(study.script().repeat.runs));
  std::atomic<std::size_t> finished{0};
  run_part(
      study, study.runs(), threads, [](std::size_t index) { return index; },
      [&](std::size_t index, const Outcome& outcome) {
        if (!outcome.refusal.empty()) throw std::invalid_argument(outcome.refusal);
        runs[index % controllers][index / controllers] = outcome.run;
        if (done) done(finished.fetch_add(1) + 1);
      });
  return runs;
}

ComparisonTable tabulate(const Study& study, const RunsByController& runs) {
  ComparisonTable table{.study = study};
  for (const auto& own : runs) table.columns.push_back(column_of(own, &own == &runs.front() ? nullptr : &runs.front()));
  const std::vector<RunResult>* ours = nullptr;
  const std::vector<RunResult>* theirs = nullptr;
  for (std::size_t c = 0; c < runs.size(); ++c) {
    if (study.contenders(0)[c].name == "adaptive") ours = &runs[c];
    if (study.contenders(0)[c].name == "sliding-mode") theirs = &runs[c];
  }
  if (ours == nullptr || theirs == nullptr) return table;
  auto& ratios = table.paper_ratios.emplace();
  std::ranges::transform(paper_metrics, ratios.begin(), [&](const PaperMetric& metric) {
    return analysis::estimate_ratio(values_of(*ours, metric.value), values_of(*theirs, metric.value));
  });
  return table;
}

}  // namespace abs_hil::study

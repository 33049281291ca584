#include "report/metric_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "report/text.hpp"

namespace abs_hil::report {

namespace {

using analysis::Metrics;

constexpr std::array<Metric, 12> list{{
    {"brake_start_s", "braking starts at / s", 3, &Metrics::brake_start_s},
    {"stop_time_s", "stop time / s", 3, &Metrics::stop_time_s},
    {"stop_distance_m", "stop distance / m", 2, &Metrics::stop_distance_m},
    {"slip_rms", "slip RMS error", 4, &Metrics::slip_rms},
    {"slip_settling_s", "slip settled after / s", 3, &Metrics::slip_settling_s},
    {"slip_overshoot", "slip overshoot", 4, &Metrics::slip_overshoot},
    {"time_locked_s", "time locked / s", 3, &Metrics::time_locked_s},
    {"torque_total_variation_Nm", "variation of torque reference / (N m)", 1, &Metrics::torque_total_variation_Nm},
    {"theta_final_N", "estimate of θ at 3 m/s / N", 2, &Metrics::theta_final_N},
    {"theta_error_final", "relative error of θ at 3 m/s", 4, &Metrics::theta_error_final},
    {"theta_error_rms", "relative RMS error of θ", 4, &Metrics::theta_error_rms},
    {"theta_settling_s", "estimate of θ settled after / s", 3, &Metrics::theta_settling_s},
}};

/// Rounding differences stay below this; a missing row exceeds it.
constexpr double tolerance = 1e-6;

}  // namespace

std::span<const Metric> metrics() { return list; }

const Metric& metric(std::string_view key) {
  const auto found = std::find_if(list.begin(), list.end(), [&](const Metric& m) { return m.key == key; });
  if (found == list.end()) throw std::out_of_range(std::string(key));
  return *found;
}

double value_of(const Metric& metric, const RunFiles& run, const RunSurvey& survey) {
  const double said = run.number(std::string(metric.key));
  return std::isfinite(said) ? said : survey.metrics.*metric.computed;
}

std::vector<std::string> contradictions(const RunFiles& run, const RunSurvey& survey) {
  std::vector<std::string> notes;
  for (const Metric& m : list) {
    const double said = run.number(std::string(m.key));
    const double computed = survey.metrics.*m.computed;
    if (!std::isfinite(said) || !std::isfinite(computed)) continue;
    if (std::abs(said - computed) <= tolerance * std::max(1.0, std::abs(said))) continue;
    notes.push_back(fmt::format(
        "{}: the summary says {} but the CSV gives {}; rows are missing, or the files belong to different runs", m.key,
        shown_significant(said, 6), shown_significant(computed, 6)));
  }
  return notes;
}

}  // namespace abs_hil::report

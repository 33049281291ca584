// Reduces a signal's values to one number while the records pass.
#include "study/signal_metrics.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abs_hil/rig/quantities.hpp"

namespace abs_hil::study {

namespace {

constexpr std::size_t columns = rig::csv_columns.size();
constexpr std::size_t nowhere = columns + rig::signal_max;

using Values = std::array<double, columns + rig::signal_max>;

constexpr std::size_t column_of(std::string_view name) {
  return static_cast<std::size_t>(std::find(rig::csv_columns.begin(), rig::csv_columns.end(), name) -
                                  rig::csv_columns.begin());
}
constexpr std::size_t time_column = column_of("time_s");
constexpr std::size_t speed_column = column_of("omega2_rad_s");
static_assert(time_column < columns && speed_column < columns);

Values values_of(const rig::CycleRecord& record, double distance_m) {
  constexpr std::int64_t no_message = 0;
  const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, no_message};
  Values values{};
  std::size_t column = 0;
  rig::for_each_quantity([&](const auto& row) {
    if (row.in_csv()) values[column++] = static_cast<double>(row.at(parts));
  });
  std::copy(record.control.signals.begin(), record.control.signals.end(), values.begin() + columns);
  return values;
}

}  // namespace

SignalMetrics::SignalMetrics(const std::vector<SignalMetric>& metrics, std::span<const rig::Signal> signals,
                             double r2_m)
    : r2_m_(r2_m) {
  for (const SignalMetric& metric : metrics) {
    std::size_t column = column_of(metric.of);
    if (column == columns) {
      const auto at = std::ranges::find(signals, metric.of, &rig::Signal::name);
      column = at == signals.end() ? nowhere : columns + static_cast<std::size_t>(at - signals.begin());
    }
    running_.push_back({.metric = metric, .column = column});
  }
}

void SignalMetrics::consume(const rig::CycleRecord& record, double distance_m) {
  const Values values = values_of(record, distance_m);
  for (Running& r : running_) {
    const bool within = record.phase == r.metric.phase;
    if (within && !r.within) r.begin_s = values[time_column];
    r.within = within;
    if (!within || r.column == nowhere || std::isnan(values[r.column])) continue;
    if (values[time_column] - r.begin_s < r.metric.after_s) continue;
    if (r.metric.above_m_s > 0.0 && !(r2_m_ * values[speed_column] > r.metric.above_m_s)) continue;
    const double value = values[r.column];
    const bool first = r.count++ == 0;
    switch (r.metric.take) {
      case Reduction::max: r.value = first ? value : std::max(r.value, value); break;
      case Reduction::min: r.value = first ? value : std::min(r.value, value); break;
      case Reduction::mean: r.value += value; break;
      case Reduction::rms: r.value += value * value; break;
      case Reduction::last: r.value = value; break;
    }
  }
}

std::vector<double> SignalMetrics::values() const {
  std::vector<double> values;
  for (const Running& r : running_) {
    const auto n = static_cast<double>(r.count);
    double value = r.value;
    if (r.metric.take == Reduction::mean) value /= n;
    if (r.metric.take == Reduction::rms) value = std::sqrt(value / n);
    values.push_back(r.count == 0 ? rig::unknown : value);
  }
  return values;
}

}  // namespace abs_hil::study

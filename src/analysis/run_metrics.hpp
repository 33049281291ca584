#pragma once

// The metrics of a run from its records.

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/braking_figures.hpp"
#include "rig/record_sink.hpp"

namespace abs_hil::analysis {

/// A figure that a run has no value for.
struct MissingFigure {
  std::string_view name;  ///< as in the summary: "stop_time_s"
  std::string why;
};
/// The figures that are missing from the metrics, each with its reason.
/// @param end_speed_m_s  as given to RunMetrics
[[nodiscard]] std::vector<MissingFigure> missing_figures(const Metrics& metrics, double end_speed_m_s);

/// The metrics as far as the figures know them.
/// @param stopped  the last record is of phase stopped, with an estimate below the end speed
[[nodiscard]] Metrics metrics_of(const BrakingFigures<double>& figures, bool stopped = false) noexcept;

/// Computes the metrics from a stream of records without storing them.
class RunMetrics final : public rig::RecordSink {
 public:
  /// @param r2_m  lower wheel's radius
  /// @param end_speed_m_s  v_x below which the car counts as stopped, > 0
  RunMetrics(double r2_m, double end_speed_m_s) : r2_m_(r2_m), figures_(end_speed_m_s) {}

  void consume(const rig::CycleRecord& record, double distance_m) override;
  [[nodiscard]] Metrics metrics() const noexcept { return metrics_of(figures_, stopped_); }
  /// True if the car has braked but not stopped so far, or moves again after a stop.
  [[nodiscard]] bool moves_on() const noexcept {
    if (!begun_) return false;
    const bool again = figures_.stop_known() && figures_.final_speed_m_s >= figures_.end_speed_m_s();
    return again || std::isnan(metrics().stop_time_s);
  }
  /// True once the stop is known and braking is over: later records change no metric.
  [[nodiscard]] bool complete() const noexcept { return !braking_ && figures_.stop_known(); }

 private:
  double r2_m_;
  BrakingFigures<double> figures_;
  bool begun_{false};
  bool braking_{false};
  bool stopped_{false};  ///< as in metrics_of
};

}  // namespace abs_hil::analysis

#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/braking_figures.hpp"
#include "rig/record_sink.hpp"

namespace abs_hil::analysis {

/// Metrics of a braking run. NaN if the run did not get that far or the backend cannot know the value. Speeds and slip
/// are true values if the backend knows them, else estimates.
struct Metrics {
  double brake_start_s{rig::unknown};  ///< first cycle in phase brake
  /// From brake_start_s to the first tick with v_x below the end speed. If the run ends up to 10 ms before that, as one
  /// whose estimate is a little below the truth: to the time at which its last deceleration leads there.
  double stop_time_s{rig::unknown};
  double stop_distance_m{rig::unknown};   ///< v_x over the ticks of the stop time, by the trapezoidal rule
  double slip_rms{rig::unknown};          ///< of slip - slip_ref, from 0.3 s after brake start while v_x > 3 m/s
  double slip_reached_s{rig::unknown};    ///< time at which slip first is within 0.02 of slip_ref while v_x > 3 m/s
  double slip_settling_s{rig::unknown};   ///< time after which slip stays within 0.02 of slip_ref while v_x > 3 m/s
  double theta_final_N{rig::unknown};     ///< estimate at 3 m/s: the last one with v_x > 3 m/s
  double theta_settling_s{rig::unknown};  ///< time after which it stays within 5 % of the truth while v_x > 3 m/s
  double torque_total_variation_Nm{rig::unknown};  ///< of the torque reference over phase brake: measures chatter
  double slip_overshoot{rig::unknown};             ///< largest slip - slip_ref while v_x > 3 m/s, >= 0
  double slip_largest{rig::unknown};               ///< largest slip while v_x > 3 m/s
  double time_locked_s{rig::unknown};              ///< braking time with slip > 0.95 while v_x > 3 m/s
  double theta_error_final{rig::unknown};          ///< theta_final_N / true theta at that time - 1
  double theta_error_rms{rig::unknown};            ///< of estimate / truth - 1, over the samples of slip_rms
  double theta_error_max_N{rig::unknown};          ///< largest |estimate - truth| over the samples of slip_rms
  double final_speed_m_s{rig::unknown};            ///< v_x of the last record
};

/// The metrics by their names in a run's summary.
inline constexpr std::array<std::pair<std::string_view, double Metrics::*>, 16> metric_fields{{
    {"brake_start_s", &Metrics::brake_start_s},
    {"stop_time_s", &Metrics::stop_time_s},
    {"stop_distance_m", &Metrics::stop_distance_m},
    {"slip_rms", &Metrics::slip_rms},
    {"slip_reached_s", &Metrics::slip_reached_s},
    {"slip_settling_s", &Metrics::slip_settling_s},
    {"slip_overshoot", &Metrics::slip_overshoot},
    {"slip_largest", &Metrics::slip_largest},
    {"time_locked_s", &Metrics::time_locked_s},
    {"torque_total_variation_Nm", &Metrics::torque_total_variation_Nm},
    {"theta_final_N", &Metrics::theta_final_N},
    {"theta_settling_s", &Metrics::theta_settling_s},
    {"theta_error_rms", &Metrics::theta_error_rms},
    {"theta_error_final", &Metrics::theta_error_final},
    {"theta_error_max_N", &Metrics::theta_error_max_N},
    {"final_speed_m_s", &Metrics::final_speed_m_s},
}};
static_assert(sizeof(Metrics) == metric_fields.size() * sizeof(double), "each metric has a name");

/// A figure that a run has no value for.
struct MissingFigure {
  std::string_view name;  ///< as in the summary: "stop_time_s"
  std::string why;
};
/// The figures that are missing from the metrics, each with its reason.
/// @param end_speed_m_s  as given to RunMetrics
[[nodiscard]] std::vector<MissingFigure> missing_figures(const Metrics& metrics, double end_speed_m_s);

/// The metrics as far as the figures know them.
[[nodiscard]] Metrics metrics_of(const BrakingFigures<double>& figures) noexcept;

/// Computes the metrics from a stream of records without storing them.
class RunMetrics final : public rig::RecordSink {
 public:
  /// @param r2_m  lower wheel's radius
  /// @param end_speed_m_s  v_x below which the car counts as stopped, > 0
  RunMetrics(double r2_m, double end_speed_m_s) : r2_m_(r2_m), figures_(end_speed_m_s) {}

  void consume(const rig::CycleRecord& record, double distance_m) override;
  [[nodiscard]] Metrics metrics() const noexcept;
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
  bool stopped_{false};  ///< the last record is of phase stopped, with an estimate below the end speed
};

}  // namespace abs_hil::analysis

// Takes the metrics of a run from its records, and says why one is missing.
#include "analysis/run_metrics.hpp"

#include <fmt/format.h>

namespace abs_hil::analysis {

namespace {
/// Longer than the error of a sound speed estimate accounts for.
constexpr double furthest_ahead_s = 0.01;
}  // namespace

void RunMetrics::consume(const rig::CycleRecord& record, double distance_m) {
  braking_ = record.phase == rig::Phase::brake;
  if (!begun_ && !braking_) return;
  begun_ = true;
  stopped_ =
      record.phase == rig::Phase::stopped && r2_m_ * record.control.speeds_est.omega2_rad_s < figures_.end_speed_m_s();
  figures_.note({.time_s = record.time_s,
                 .v_x_m_s = r2_m_ * rig::best_speeds(record).omega2_rad_s,
                 .distance_m = distance_m,
                 .slip = rig::best_slip(record),
                 .slip_ref = record.control.slip_ref,
                 .torque_ref_Nm = record.control.brake_torque_ref_Nm,
                 .theta_est_N = record.control.theta_est_N,
                 .theta_N = record.truth.theta_N},
                braking_);
}

Metrics metrics_of(const BrakingFigures<double>& f, bool stopped) noexcept {
  Metrics result = f;
  result.slip_settling_s = f.slip_settling.since_s();
  result.theta_settling_s = f.theta_settling.since_s();
  if (f.samples > 0.0) {
    result.slip_rms = std::sqrt(f.slip_square_sum / f.samples);
    result.theta_error_rms = std::sqrt(f.theta_square_sum / f.samples);
  }
  const double end_speed_m_s = f.end_speed_m_s();
  if (stopped && !f.stop_known() && f.deceleration_m_s2 > 0.0) {
    // The sequence ends on the estimated speed. The true one may cross the end speed a few cycles later.
    const double ahead_s = (f.final_speed_m_s - end_speed_m_s) / f.deceleration_m_s2;
    if (ahead_s <= furthest_ahead_s) {
      result.stop_time_s = f.last_time_s - f.brake_start_s + ahead_s;
      result.stop_distance_m = f.last_distance_m + 0.5 * (f.final_speed_m_s + end_speed_m_s) * ahead_s;
    }
  }
  // A braking that was cut off has no estimate at the speed that the figure names. The last one may come from the very
  // readings that ended it.
  const bool moves_on = f.stop_known() ? f.final_speed_m_s >= end_speed_m_s : std::isnan(result.stop_time_s);
  if (moves_on && f.final_speed_m_s > least_judged_speed_m_s) {
    result.theta_final_N = result.theta_error_final = rig::unknown;
  }
  return result;
}

std::vector<MissingFigure> missing_figures(const Metrics& m, double end_speed_m_s) {
  std::vector<MissingFigure> missing;
  for (const Figure& figure : figures) {
    if (figure.lacking.empty() || !std::isnan(figure.of(m))) continue;
    const std::string_view why = std::isnan(m.brake_start_s) ? figures.front().lacking : figure.lacking;
    missing.push_back(
        {figure.name, fmt::format(fmt::runtime(why), fmt::arg("speed", m.final_speed_m_s),
                                  fmt::arg("end", end_speed_m_s), fmt::arg("judged", least_judged_speed_m_s),
                                  fmt::arg("rms_start", BrakingFigures<double>::rms_start_s),
                                  fmt::arg("slip_band", BrakingFigures<double>::slip_band),
                                  fmt::arg("theta_per_cent", 100 * BrakingFigures<double>::theta_band))});
  }
  return missing;
}

}  // namespace abs_hil::analysis

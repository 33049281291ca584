#include "analysis/run_metrics.hpp"

#include <fmt/format.h>

#include <cmath>

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

Metrics metrics_of(const BrakingFigures<double>& f) noexcept {
  Metrics result{.brake_start_s = f.brake_start_s,
                 .stop_time_s = f.stop_time_s,
                 .stop_distance_m = f.stop_distance_m,
                 .slip_reached_s = f.slip_reached_s,
                 .slip_settling_s = f.slip_settling.since_s(),
                 .theta_final_N = f.theta_final_N,
                 .theta_settling_s = f.theta_settling.since_s(),
                 .torque_total_variation_Nm = f.torque_total_variation_Nm,
                 .slip_overshoot = f.slip_overshoot,
                 .slip_largest = f.slip_largest,
                 .time_locked_s = f.time_locked_s,
                 .theta_error_final = f.theta_error_final,
                 .theta_error_max_N = f.theta_error_max_N,
                 .final_speed_m_s = f.final_speed_m_s};
  if (f.samples > 0.0) {
    result.slip_rms = std::sqrt(f.slip_square_sum / f.samples);
    result.theta_error_rms = std::sqrt(f.theta_square_sum / f.samples);
  }
  return result;
}

Metrics RunMetrics::metrics() const noexcept {
  Metrics result = metrics_of(figures_);
  if (stopped_ && std::isnan(result.stop_time_s) && figures_.deceleration_m_s2 > 0.0) {
    // The sequence ends on the estimated speed. The true one may cross the end speed a few cycles later.
    const double end_speed_m_s = figures_.end_speed_m_s();
    const double ahead_s = (result.final_speed_m_s - end_speed_m_s) / figures_.deceleration_m_s2;
    if (ahead_s <= furthest_ahead_s) {
      result.stop_time_s = figures_.last_time_s - result.brake_start_s + ahead_s;
      result.stop_distance_m = figures_.last_distance_m + 0.5 * (result.final_speed_m_s + end_speed_m_s) * ahead_s;
    }
  }
  return result;
}

std::vector<MissingFigure> missing_figures(const Metrics& m, double end_speed_m_s) {
  std::vector<MissingFigure> missing;
  const bool braked = !std::isnan(m.brake_start_s);
  const auto note = [&](std::string_view name, double value, const std::string& why) {
    if (std::isnan(value)) missing.push_back({name, braked ? why : "the run did not brake"});
  };
  const std::string moving = fmt::format("the car still moved at {:.3g} m/s when the run ended; it stops below {:.3g}",
                                         m.final_speed_m_s, end_speed_m_s);
  const std::string above = fmt::format("above {:.3g} m/s", least_judged_speed_m_s);
  note("brake_start_s", m.brake_start_s, "");
  note("stop_time_s", m.stop_time_s, moving);
  note("stop_distance_m", m.stop_distance_m, moving);
  note("slip_rms", m.slip_rms,
       fmt::format("no braking {} later than {} s after its start", above, BrakingFigures<double>::rms_start_s));
  note("slip_reached_s", m.slip_reached_s,
       fmt::format("the slip never came within {} of the wanted one {}", BrakingFigures<double>::slip_band, above));
  note("slip_settling_s", m.slip_settling_s,
       fmt::format("the slip left its band, {}, {}", BrakingFigures<double>::slip_band, above));
  note("theta_final_N", m.theta_final_N, fmt::format("no estimate {}", above));
  note("theta_settling_s", m.theta_settling_s,
       fmt::format("no estimate within {} % of the true theta {}", 100 * BrakingFigures<double>::theta_band, above));
  return missing;
}

}  // namespace abs_hil::analysis

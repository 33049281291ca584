#include "analysis/run_metrics.hpp"

#include <fmt/format.h>

#include <cmath>

namespace abs_hil::analysis {

namespace {
constexpr double rms_start_s = 0.3;
/// Slower than this the slip dynamics stiffen as 1 / v_x and the paper calls the performance "no longer relevant".
constexpr double slip_band = 0.02;
constexpr double theta_band = 0.05;
/// A wheel below a twentieth of the car's speed can be steered no better than a locked one.
constexpr double locked_slip = 0.95;
constexpr double deceleration_interval_s = 0.01;
/// Longer than the error of a sound speed estimate accounts for.
constexpr double furthest_ahead_s = 0.01;
}  // namespace

void RunMetrics::consume_braking(const rig::CycleRecord& record, double since_brake_s, double v_x_m_s) {
  const double torque_Nm = record.control.brake_torque_ref_Nm;
  if (std::isnan(last_torque_Nm_)) {
    metrics_.torque_total_variation_Nm = 0.0;
  } else {
    metrics_.torque_total_variation_Nm += std::abs(torque_Nm - last_torque_Nm_);
  }
  last_torque_Nm_ = torque_Nm;
  if (v_x_m_s <= least_judged_speed_m_s) return;

  const double slip = rig::best_slip(record);
  const double slip_error = slip - record.control.slip_ref;
  metrics_.slip_overshoot = std::fmax(metrics_.slip_overshoot, std::fmax(0.0, slip_error));  // fmax skips NaN
  if (std::isnan(metrics_.time_locked_s)) metrics_.time_locked_s = 0.0;
  if (slip > locked_slip && !std::isnan(last_time_s_)) metrics_.time_locked_s += record.time_s - last_time_s_;
  slip_settling_.observe(since_brake_s, std::abs(slip_error) <= slip_band);
  metrics_.theta_final_N = record.control.theta_est_N;
  metrics_.theta_error_final = record.control.theta_est_N / record.truth.theta_N - 1.0;
  if (since_brake_s > rms_start_s) {
    slip_square_sum_ += slip_error * slip_error;
    theta_square_sum_ += metrics_.theta_error_final * metrics_.theta_error_final;
    ++slip_samples_;
  }
  const double theta_error = std::abs(record.control.theta_est_N - record.truth.theta_N);
  theta_settling_.observe(since_brake_s, theta_error <= theta_band * record.truth.theta_N);
}

void RunMetrics::consume(const rig::CycleRecord& record, double distance_m) {
  braking_ = record.phase == rig::Phase::brake;
  if (std::isnan(metrics_.brake_start_s)) {
    if (!braking_) return;
    metrics_.brake_start_s = record.time_s;
  }
  const double since_brake_s = record.time_s - metrics_.brake_start_s;
  const double v_x_m_s = r2_m_ * rig::best_speeds(record).omega2_rad_s;
  metrics_.final_speed_m_s = v_x_m_s;
  last_distance_m_ = distance_m;
  stopped_ = record.phase == rig::Phase::stopped && r2_m_ * record.control.speeds_est.omega2_rad_s < end_speed_m_s_;
  note_deceleration(record.time_s, v_x_m_s);
  if (braking_) consume_braking(record, since_brake_s, v_x_m_s);
  last_time_s_ = record.time_s;
  if (std::isnan(metrics_.stop_time_s) && since_brake_s > 0.0 && v_x_m_s < end_speed_m_s_) {
    metrics_.stop_time_s = since_brake_s;
    metrics_.stop_distance_m = distance_m;
  }
}

void RunMetrics::note_deceleration(double time_s, double v_x_m_s) noexcept {
  if (time_s - interval_start_s_ < deceleration_interval_s) return;
  if (!std::isnan(interval_start_s_)) {
    deceleration_m_s2_ = (interval_start_m_s_ - v_x_m_s) / (time_s - interval_start_s_);
  }
  interval_start_s_ = time_s;
  interval_start_m_s_ = v_x_m_s;
}

Metrics RunMetrics::metrics() const noexcept {
  Metrics result = metrics_;
  if (stopped_ && std::isnan(result.stop_time_s) && deceleration_m_s2_ > 0.0) {
    // The sequence ends on the estimated speed. The true one may cross the end speed a few cycles later.
    const double ahead_s = (result.final_speed_m_s - end_speed_m_s_) / deceleration_m_s2_;
    if (ahead_s <= furthest_ahead_s) {
      result.stop_time_s = last_time_s_ - result.brake_start_s + ahead_s;
      result.stop_distance_m = last_distance_m_ + 0.5 * (result.final_speed_m_s + end_speed_m_s_) * ahead_s;
    }
  }
  if (slip_samples_ > 0) {
    result.slip_rms = std::sqrt(slip_square_sum_ / static_cast<double>(slip_samples_));
    result.theta_error_rms = std::sqrt(theta_square_sum_ / static_cast<double>(slip_samples_));
  }
  result.slip_settling_s = slip_settling_.since_s();
  result.theta_settling_s = theta_settling_.since_s();
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
  note("slip_rms", m.slip_rms, fmt::format("no braking {} later than {} s after its start", above, rms_start_s));
  note("slip_settling_s", m.slip_settling_s, fmt::format("the slip left its band, {}, {}", slip_band, above));
  note("theta_final_N", m.theta_final_N, fmt::format("no estimate {}", above));
  note("theta_settling_s", m.theta_settling_s,
       fmt::format("no estimate within {} % of the true theta {}", 100 * theta_band, above));
  return missing;
}

}  // namespace abs_hil::analysis

#include "analysis/run_metrics.hpp"

#include <cmath>

namespace abs_hil::analysis {

namespace {
constexpr double rms_start_s = 0.3;
/// Slower than this the slip dynamics stiffen as 1 / v_x and the paper calls the performance "no longer relevant".
constexpr double slip_band = 0.02;
constexpr double theta_band = 0.05;
/// A wheel below a twentieth of the car's speed can be steered no better than a locked one.
constexpr double locked_slip = 0.95;
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
  if (braking_) consume_braking(record, since_brake_s, v_x_m_s);
  last_time_s_ = record.time_s;
  if (std::isnan(metrics_.stop_time_s) && since_brake_s > 0.0 && v_x_m_s < end_speed_m_s_) {
    metrics_.stop_time_s = since_brake_s;
    metrics_.stop_distance_m = distance_m;
  }
}

Metrics RunMetrics::metrics() const {
  Metrics result = metrics_;
  if (slip_samples_ > 0) {
    result.slip_rms = std::sqrt(slip_square_sum_ / static_cast<double>(slip_samples_));
    result.theta_error_rms = std::sqrt(theta_square_sum_ / static_cast<double>(slip_samples_));
  }
  result.slip_settling_s = slip_settling_.since_s();
  result.theta_settling_s = theta_settling_.since_s();
  return result;
}

}  // namespace abs_hil::analysis

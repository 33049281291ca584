#include "abs_hil/analysis/run_metrics.hpp"

#include <cmath>

namespace abs_hil::analysis {

namespace {
constexpr double rms_start_s = 0.3;
/// Slower than this the slip dynamics stiffen as 1 / v_x and the paper calls the performance "no longer relevant".
constexpr double least_speed_m_s = 3.0;
constexpr double slip_band = 0.02;
constexpr double theta_band = 0.05;
}  // namespace

void RunMetrics::consume_braking(const rig::CycleRecord& record, double since_brake_s, double v_x_m_s) {
  const double torque_Nm = record.control.brake_torque_ref_Nm;
  if (std::isnan(last_torque_Nm_)) {
    metrics_.torque_total_variation_Nm = 0.0;
  } else {
    metrics_.torque_total_variation_Nm += std::abs(torque_Nm - last_torque_Nm_);
  }
  last_torque_Nm_ = torque_Nm;
  if (v_x_m_s <= least_speed_m_s) return;

  const double slip_error = rig::best_slip(record) - record.control.slip_ref;
  slip_settling_.observe(since_brake_s, std::abs(slip_error) <= slip_band);
  if (since_brake_s > rms_start_s) {
    slip_square_sum_ += slip_error * slip_error;
    ++slip_samples_;
  }
  metrics_.theta_final_N = record.control.theta_est_N;
  const double theta_error = std::abs(record.control.theta_est_N - record.truth.theta_N);
  theta_settling_.observe(since_brake_s, theta_error <= theta_band * record.truth.theta_N);
}

void RunMetrics::consume(const rig::CycleRecord& record, double distance_m) {
  const bool braking = record.phase == rig::Phase::brake;
  if (std::isnan(metrics_.brake_start_s)) {
    if (!braking) return;
    metrics_.brake_start_s = record.time_s;
  }
  const double since_brake_s = record.time_s - metrics_.brake_start_s;
  const double v_x_m_s = r2_m_ * rig::best_speeds(record).omega2_rad_s;
  if (braking) consume_braking(record, since_brake_s, v_x_m_s);
  if (std::isnan(metrics_.stop_time_s) && since_brake_s > 0.0 && v_x_m_s < end_speed_m_s_) {
    metrics_.stop_time_s = since_brake_s;
    metrics_.stop_distance_m = distance_m;
  }
}

Metrics RunMetrics::metrics() const {
  Metrics result = metrics_;
  if (slip_samples_ > 0) result.slip_rms = std::sqrt(slip_square_sum_ / static_cast<double>(slip_samples_));
  result.slip_settling_s = slip_settling_.since_s();
  result.theta_settling_s = theta_settling_.since_s();
  return result;
}

}  // namespace abs_hil::analysis

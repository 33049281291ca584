#include "analysis/friction_curve.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "abs_hil/rig/encoder_scale.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "analysis/json_number.hpp"

namespace abs_hil::analysis {

namespace {

constexpr double half_window_s = 0.03;
constexpr std::size_t least_samples = 12;  ///< per window: enough samples to average over a cubic
constexpr double slow_m_s = 1.0;           ///< below this speed slip is mostly encoder error
constexpr double near_peak = 0.85;         ///< points above this share of the largest force define the peak
constexpr std::size_t least_peak_points = 20;
constexpr int grid = 2000;

/// Speed and acceleration in the middle of a window.
struct Motion {
  double omega_rad_s;
  double alpha_rad_s2;
};

/// Least-squares cubic; one column of `angles` per wheel.
using Angles = Eigen::Matrix<double, Eigen::Dynamic, 2>;

std::array<Motion, 2> fitted(const Eigen::VectorXd& times_s, const Angles& angles_rad) {
  // Times in units of the half window keep the normal equations well conditioned.
  Eigen::Matrix<double, Eigen::Dynamic, 4> powers(times_s.size(), 4);
  const Eigen::ArrayXd x = times_s.array() / half_window_s;
  powers << Eigen::ArrayXd::Ones(x.size()), x, x.square(), x.cube();
  const Eigen::Matrix4d normal = powers.transpose() * powers;
  const Eigen::Matrix<double, 4, 2> c = normal.ldlt().solve(powers.transpose() * angles_rad);
  const auto motion = [&c](Eigen::Index wheel) {
    return Motion{c(1, wheel) / half_window_s, 2.0 * c(2, wheel) / (half_window_s * half_window_s)};
  };
  return {motion(0), motion(1)};
}

/// The peak of a cubic in ln(slip) through the points near the largest force.
void find_peak(FrictionCurveResult& result) {
  double largest_N = 0.0;
  for (const FrictionPoint& point : result.points) largest_N = std::max(largest_N, point.force_N);
  std::vector<FrictionPoint> near;
  for (const FrictionPoint& point : result.points) {
    if (point.slip > 0.0 && point.force_N > near_peak * largest_N) near.push_back(point);
  }
  if (near.size() < least_peak_points) return;
  const auto n = static_cast<Eigen::Index>(near.size());
  Eigen::ArrayXd x(n);
  Eigen::VectorXd force(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    x[i] = std::log(near[static_cast<std::size_t>(i)].slip);
    force[i] = near[static_cast<std::size_t>(i)].force_N;
  }
  const double middle = x.mean();
  Eigen::Matrix<double, Eigen::Dynamic, 4> powers(n, 4);
  const Eigen::ArrayXd from_middle = x - middle;
  powers << Eigen::ArrayXd::Ones(n), from_middle, from_middle.square(), from_middle.cube();
  const Eigen::Vector4d c = powers.colPivHouseholderQr().solve(force);
  const double least = x.minCoeff();
  const double most = x.maxCoeff();
  int best = 0;
  double best_N = -1.0;
  for (int i = 0; i <= grid; ++i) {
    const double at = std::lerp(least, most, static_cast<double>(i) / grid) - middle;
    const double value_N = c[0] + at * (c[1] + at * (c[2] + at * c[3]));
    if (value_N > best_N) {
      best_N = value_N;
      best = i;
    }
  }
  // If the largest value is at an end, the run did not pass a peak.
  if (best == 0 || best == grid) return;
  result.peak_force_N = best_N;
  result.peak_slip = std::exp(std::lerp(least, most, static_cast<double>(best) / grid));
}

}  // namespace

FrictionCurve::FrictionCurve(const rig::WheelParameters& wheels, std::int32_t counts_per_rev)
    : wheels_(wheels), rad_per_count_(rig::radians_per_count(counts_per_rev)) {}

void FrictionCurve::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  if (record.phase != rig::Phase::brake) return;
  const rig::Measurement& m = record.measurement;
  if (samples_.empty()) {
    start_ns_ = m.time_ns;
    samples_.push_back({0.0, 0, 0});
  } else {
    const Sample& last = samples_.back();
    samples_.push_back({static_cast<double>(m.time_ns - start_ns_) * 1e-9,
                        last.upper + rig::counts_between(last_upper_, m.upper_counts),
                        last.lower + rig::counts_between(last_lower_, m.lower_counts)});
  }
  last_upper_ = m.upper_counts;
  last_lower_ = m.lower_counts;
}

FrictionCurveResult FrictionCurve::result() const {
  FrictionCurveResult result;
  const double last_s = samples_.empty() ? 0.0 : samples_.back().time_s;
  std::size_t first = 0;
  std::size_t end = 0;
  for (const Sample& middle : samples_) {
    if (middle.time_s < half_window_s || middle.time_s > last_s - half_window_s) continue;
    while (samples_[first].time_s < middle.time_s - half_window_s) ++first;
    while (end < samples_.size() && samples_[end].time_s <= middle.time_s + half_window_s) ++end;
    if (end - first < least_samples) continue;
    const auto n = static_cast<Eigen::Index>(end - first);
    Eigen::VectorXd times_s(n);
    Angles angles_rad(n, 2);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Sample& sample = samples_[first + static_cast<std::size_t>(i)];
      times_s[i] = sample.time_s - middle.time_s;
      angles_rad(i, 0) = static_cast<double>(sample.upper - middle.upper) * rad_per_count_;
      angles_rad(i, 1) = static_cast<double>(sample.lower - middle.lower) * rad_per_count_;
    }
    const auto [upper, lower] = fitted(times_s, angles_rad);
    const double v_x_m_s = wheels_.r2_m * lower.omega_rad_s;
    if (v_x_m_s < slow_m_s) continue;
    result.points.push_back(
        {.time_s = middle.time_s,
         .slip = rig::wheel_slip(wheels_.r1_m * upper.omega_rad_s, v_x_m_s, slow_m_s),
         .force_N = -(wheels_.J2_kg_m2 * lower.alpha_rad_s2 + wheels_.d2_Nms_rad * lower.omega_rad_s + wheels_.M20_Nm) /
                    wheels_.r2_m});
  }
  find_peak(result);
  return result;
}

std::string to_csv(const FrictionCurveResult& result) {
  std::string text = "time_s,slip,force_N\n";
  for (const FrictionPoint& p : result.points) text += fmt::format("{},{},{}\n", p.time_s, p.slip, p.force_N);
  return text;
}

nlohmann::ordered_json to_json(const FrictionCurveResult& result) {
  return {{"peak_force_N", number_or_null(result.peak_force_N)},
          {"peak_slip", number_or_null(result.peak_slip)},
          {"points", result.points.size()}};
}

}  // namespace abs_hil::analysis

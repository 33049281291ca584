// Traces friction over slip from encoder counts, by cubics through the counts around each reading.
#include "analysis/friction_curve.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "abs_hil/rig/tyre_curve.hpp"
#include "analysis/run_summary.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::analysis {

namespace {

constexpr double half_window_s = friction_half_window_s;
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

/// Least-squares cubics through points that arrive one by one, one column of `values` for each cubic. The points should
/// lie within [-1, 1]: that keeps the normal equations well conditioned. Matrices of fixed size compile fast.
template <int columns>
class CubicFit {
 public:
  void add(double x, const Eigen::Matrix<double, 1, columns>& values) {
    const Eigen::Vector4d powers{1.0, x, x * x, x * x * x};
    normal_ += powers * powers.transpose();
    moments_ += powers * values;
  }
  /// Coefficients from the constant upwards.
  [[nodiscard]] Eigen::Matrix<double, 4, columns> coefficients() const { return normal_.ldlt().solve(moments_); }

 private:
  Eigen::Matrix4d normal_ = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, columns> moments_ = Eigen::Matrix<double, 4, columns>::Zero();
};

/// Wheel `wheel`'s motion in the middle of a window, of the cubics through the angles over the time / half window.
Motion motion_of(const Eigen::Matrix<double, 4, 2>& cubics, int wheel) {
  return {cubics(1, wheel) / half_window_s, 2.0 * cubics(2, wheel) / (half_window_s * half_window_s)};
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
  const auto [low, high] = std::ranges::minmax_element(near, {}, &FrictionPoint::slip);
  const double least = std::log(low->slip);
  const double most = std::log(high->slip);
  if (least == most) return;
  CubicFit<1> fit;
  const auto scaled = [&](double log_slip) { return (2.0 * log_slip - least - most) / (most - least); };
  for (const FrictionPoint& point : near)
    fit.add(scaled(std::log(point.slip)), Eigen::Matrix<double, 1, 1>{point.force_N});
  const Eigen::Vector4d c = fit.coefficients();
  int best = 0;
  double best_N = -1.0;
  for (int i = 0; i <= grid; ++i) {
    const double at = scaled(std::lerp(least, most, static_cast<double>(i) / grid));
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

std::optional<FrictionPoint> friction_point(std::span<const EncoderSample> window, const EncoderSample& middle,
                                            const rig::WheelParameters& wheels, double rad_per_count) {
  if (window.size() < least_samples) return std::nullopt;
  CubicFit<2> fit;
  for (const EncoderSample& sample : window) {
    fit.add((sample.time_s - middle.time_s) / half_window_s,
            {static_cast<double>(sample.upper - middle.upper) * rad_per_count,
             static_cast<double>(sample.lower - middle.lower) * rad_per_count});
  }
  const Eigen::Matrix<double, 4, 2> cubics = fit.coefficients();
  const Motion upper = motion_of(cubics, 0);
  const Motion lower = motion_of(cubics, 1);
  const double v_x_m_s = wheels.r2_m * lower.omega_rad_s;
  if (!(v_x_m_s >= slow_m_s)) return std::nullopt;
  return FrictionPoint{
      .time_s = middle.time_s,
      .slip = rig::wheel_slip(wheels.r1_m * upper.omega_rad_s, v_x_m_s, slow_m_s),
      .force_N = -(wheels.J2_kg_m2 * lower.alpha_rad_s2 + wheels.d2_Nms_rad * lower.omega_rad_s + wheels.M20_Nm) /
                 wheels.r2_m};
}

FrictionCurve::FrictionCurve(const rig::WheelParameters& wheels, std::int32_t counts_per_rev)
    : wheels_(wheels), rad_per_count_(rig::radians_per_count(counts_per_rev)) {}

void FrictionCurve::consume(const rig::CycleRecord& record, double /*distance_m*/) {
  if (record.phase != rig::Phase::brake) return;
  const rig::Measurement& m = record.measurement;
  if (samples_.empty()) {
    start_ns_ = m.time_ns;
    samples_.push_back({0.0, 0, 0});
  } else {
    const EncoderSample& last = samples_.back();
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
  for (const EncoderSample& middle : samples_) {
    if (middle.time_s < half_window_s || middle.time_s > last_s - half_window_s) continue;
    while (samples_[first].time_s < middle.time_s - half_window_s) ++first;
    while (end < samples_.size() && samples_[end].time_s <= middle.time_s + half_window_s) ++end;
    if (const auto point =
            friction_point(std::span(samples_).subspan(first, end - first), middle, wheels_, rad_per_count_))
      result.points.push_back(*point);
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

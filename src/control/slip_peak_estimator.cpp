#include "control/slip_peak_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::control {
namespace {

// Initial standard deviations of the logarithms, the shape and the slip's zero.
constexpr double log_force_spread = 1.0;
constexpr double log_width_spread = 0.6;
constexpr double shape0 = 1.0;
constexpr double shape_spread = 1.0;
constexpr double zero_spread = 0.01;
// Bounds of the unknowns. The controller gives the bounds of the width.
constexpr double log_force_max = 7.0;
constexpr double shape_min = -0.5;
constexpr double shape_max = 20.0;
constexpr double zero_max = 0.03;
// Jumps of friction.
constexpr double jump_window_s = 0.015;
constexpr double rollback_s = 0.03;
constexpr double kept_every_s = 1e-3;
constexpr double jump_least_N = 3.0;         ///< three standard deviations of the force estimate
constexpr double jump_force_spread = 0.5;    ///< of the logarithm of the level after a jump
constexpr double level_known_spread = 0.12;  ///< jumps are detected only once the level is known to this accuracy

struct CurvePoint {
  double value;
  double slope;     ///< by x
  double by_shape;  ///< derivative by c
};

CurvePoint curve(double x, double c) noexcept {
  const double a = std::abs(x);
  const double d = 1.0 + c * a + a * a;
  return {(2.0 + c) * x / d, (2.0 + c) * (1.0 - a * a) / (d * d), x * (1.0 - a) * (1.0 - a) / (d * d)};
}

std::size_t at_least_one(double count) { return static_cast<std::size_t>(std::max(1L, std::lround(count))); }

}  // namespace

SlipPeakEstimator::SlipPeakEstimator(const SlipPeakOptions& options, double slip_min, double slip_max, double rate_Hz)
    : options_{options},
      log_slip_min_{std::log(slip_min)},
      log_slip_max_{std::log(slip_max)},
      sample_variance_N2_{options.force_noise_N2_s * rate_Hz},
      decimation_{at_least_one(kept_every_s * rate_Hz)},
      window_{at_least_one(jump_window_s * rate_Hz / static_cast<double>(decimation_))},
      rollback_{at_least_one(rollback_s * rate_Hz / static_cast<double>(decimation_))},
      samples_(std::max(window_, rollback_) + 1) {
  rig::require_valid(options, "control.adaptive_peak.");
  if (!(0.0 < slip_min && slip_min < slip_max && rate_Hz > 0.0)) {
    throw std::invalid_argument("the slip peak estimator needs 0 < slip_min < slip_max and a control rate > 0 Hz");
  }
  if (!(options.peak_slip0 >= slip_min && options.peak_slip0 <= slip_max)) {
    throw std::invalid_argument("control.adaptive_peak.peak_slip0 must be in [slip_min, slip_max]");
  }
  reset();
}

void SlipPeakEstimator::reset() noexcept {
  state_ << std::log(options_.peak_force0_N), std::log(options_.peak_slip0), shape0, 0.0;
  covariance_ = Eigen::Vector4d(log_force_spread * log_force_spread, log_width_spread * log_width_spread,
                                shape_spread * shape_spread, zero_spread * zero_spread)
                    .asDiagonal();
  kept_count_ = 0;
  cycle_ = 0;
  hold_s_ = 0.0;
  jumps_ = 0;
}

void SlipPeakEstimator::update(double dt_s, double slip, double force_N) noexcept {
  if (!(dt_s > 0.0)) return;
  covariance_(log_force, log_force) += options_.force_drift_per_s * dt_s;
  covariance_(log_width, log_width) += options_.slip_drift_per_s * dt_s;
  covariance_(shape, shape) += options_.shape_drift_per_s * dt_s;
  if (hold_s_ > 0.0) {
    hold_s_ -= dt_s;
    learn(slip, force_N, true);
    return;
  }
  keep(slip, force_N);
  if (jumped(slip, force_N)) {
    start_over_after_jump();
  } else {
    learn(slip, force_N, false);
  }
}

void SlipPeakEstimator::keep(double slip, double force_N) noexcept {
  if (cycle_++ % decimation_ != 0) return;
  samples_[kept_count_++ % samples_.size()] = {slip, force_N, state_};
}

const SlipPeakEstimator::Sample& SlipPeakEstimator::kept(std::size_t back) const noexcept {
  return samples_[(kept_count_ - 1 - std::min(back, kept_count_ - 1)) % samples_.size()];
}

bool SlipPeakEstimator::jumped(double slip, double force_N) const noexcept {
  const bool level_known = covariance_(log_force, log_force) < level_known_spread * level_known_spread;
  if (!level_known || kept_count_ <= window_) return false;
  const Sample& past = kept(window_);
  const double unexplained = force_N - past.force_N - (this->force_N(slip) - this->force_N(past.slip));
  // The curve is least accurate for long moves along it.
  const double trusted = options_.jump_level + std::abs(slip - past.slip) / width();
  return std::abs(unexplained) > std::max(jump_least_N, peak_force_N() * trusted);
}

void SlipPeakEstimator::start_over_after_jump() noexcept {
  const State& before = kept(rollback_).state;
  state_[log_width] = before[log_width];
  state_[shape] = before[shape];
  covariance_.row(log_force).setZero();
  covariance_.col(log_force).setZero();
  covariance_(log_force, log_force) = jump_force_spread * jump_force_spread;
  hold_s_ = options_.jump_hold_s;
  kept_count_ = 0;
  cycle_ = 0;
  ++jumps_;
}

void SlipPeakEstimator::learn(double slip, double force_N, bool level_only) noexcept {
  const double peak_N = peak_force_N();
  const double x = (slip + state_[zero]) / width();
  const CurvePoint c = curve(x, state_[shape]);
  const double residual = force_N - peak_N * c.value;
  const Eigen::Vector4d gradient{peak_N * c.value, -peak_N * x * c.slope, peak_N * c.by_shape,
                                 peak_N * c.slope / width()};
  const Eigen::Vector4d reach = covariance_ * gradient;
  const double variance = gradient.dot(reach) + sample_variance_N2_;
  if (level_only) {
    const double gain = reach[log_force] / variance;
    state_[log_force] += gain * residual;
    covariance_(log_force, log_force) -= gain * (2.0 * reach[log_force] - gain * variance);
  } else {
    state_ += reach / variance * residual;
    covariance_ -= reach * reach.transpose() / variance;
    covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  }
  state_[log_force] = std::clamp(state_[log_force], 0.0, log_force_max);
  state_[log_width] = std::clamp(state_[log_width], log_slip_min_, log_slip_max_);
  state_[shape] = std::clamp(state_[shape], shape_min, shape_max);
  state_[zero] = std::clamp(state_[zero], -zero_max, zero_max);
}

double SlipPeakEstimator::width() const noexcept { return std::exp(state_[log_width]); }

double SlipPeakEstimator::peak_force_N() const noexcept { return std::exp(state_[log_force]); }

double SlipPeakEstimator::peak_slip() const noexcept { return width() - state_[zero]; }

double SlipPeakEstimator::force_N(double slip) const noexcept {
  return peak_force_N() * curve((slip + state_[zero]) / width(), state_[shape]).value;
}

double SlipPeakEstimator::force_slope_N(double slip) const noexcept {
  return peak_force_N() / width() * curve((slip + state_[zero]) / width(), state_[shape]).slope;
}

}  // namespace abs_hil::control

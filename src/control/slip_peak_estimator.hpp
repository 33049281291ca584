#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Estimates the slip of the largest tyre force from pairs of slip and force only. It is an extended Kalman filter for
///   F = Fp (2 + c) x / (1 + c |x| + x^2),   x = (slip + zero) / width,
/// which rises to Fp at x = 1 and then falls, more slowly for larger c. This is the simplest curve with a peak, not the
/// plant's own curve. Unknowns: ln Fp, ln width, c and `zero`, the error of the measured slip at no force (wheel
/// radii). All unknowns drift as random walks, the level Fp fastest. So the filter learns the peak's slip from the
/// response of the force to the search, not from the level of the force.
///
/// If the force changes over 15 ms and no move along the curve explains the change, the friction has jumped. Then the
/// filter learns the level again, for `jump_hold_s` only the level, and discards what it learnt in the last 30 ms.
/// `reset` and `update` are real-time safe.
class SlipPeakEstimator {
 public:
  /// @param slip_min, slip_max  bounds of `width`; 0 < slip_min < slip_max
  /// @param rate_Hz  control cycles per second, > 0
  /// Throws std::invalid_argument for options out of range.
  SlipPeakEstimator(const SlipPeakOptions& options, double slip_min, double slip_max, double rate_Hz);

  void reset() noexcept;
  /// One measured pair, both of the same time, `dt_s` > 0 after the previous pair.
  void update(double dt_s, double slip, double force_N) noexcept;

  [[nodiscard]] double peak_force_N() const noexcept;
  /// Measured slip at which the force peaks.
  [[nodiscard]] double peak_slip() const noexcept;
  /// The curve and its slope at a measured slip.
  [[nodiscard]] double force_N(double slip) const noexcept;
  [[nodiscard]] double force_slope_N(double slip) const noexcept;
  /// Jumps of friction found since the last `reset`.
  [[nodiscard]] int jumps() const noexcept { return jumps_; }

 private:
  using State = Eigen::Vector4d;
  enum Index : Eigen::Index { log_force, log_width, shape, zero };
  struct Sample {
    double slip{0.0};
    double force_N{0.0};
    State state{State::Zero()};
  };

  void keep(double slip, double force_N) noexcept;
  [[nodiscard]] const Sample& kept(std::size_t back) const noexcept;
  [[nodiscard]] bool jumped(double slip, double force_N) const noexcept;
  void start_over_after_jump() noexcept;
  void learn(double slip, double force_N, bool level_only) noexcept;
  [[nodiscard]] double width() const noexcept;

  SlipPeakOptions options_;
  double log_slip_min_;
  double log_slip_max_;
  double sample_variance_N2_;  ///< of one pair, scaled so that the information per second does not depend on the rate
  std::size_t decimation_;     ///< cycles between kept samples, 1 ms or one cycle
  std::size_t window_;         ///< kept samples in 15 ms and in 30 ms
  std::size_t rollback_;
  State state_{State::Zero()};
  Eigen::Matrix4d covariance_{Eigen::Matrix4d::Zero()};
  std::vector<Sample> samples_;  ///< a ring that reaches back over the longer of the two
  std::size_t kept_count_{0};
  std::size_t cycle_{0};
  double hold_s_{0.0};
  int jumps_{0};
};

}  // namespace abs_hil::control

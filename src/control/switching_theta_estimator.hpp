#pragma once

#include <algorithm>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Estimator of the peak tyre force for a sliding-mode law,
///   theta_hat' = -gamma k(slip_ref) phi(slip) s,   where s in [-1, 1] is the substitute for sign(e_v),
/// projected onto [theta_min_N, theta_max_N]. If e_v' = -k phi (theta - theta_hat) - K s + d, then
/// V = |e_v| + (theta - theta_hat)^2/(2 gamma) falls at K - |d| or faster until e_v = 0, for either sign of phi
/// (docs/theory-baselines.md). Real-time safe.
class SwitchingThetaEstimator {
 public:
  /// Throws std::invalid_argument for a gain or bounds out of range.
  explicit SwitchingThetaEstimator(const SwitchingAdaptationOptions& options);

  void reset() noexcept { theta_N_ = theta0_N_; }
  /// Takes over the other's estimate, limited to the own bounds.
  void take_over(const SwitchingThetaEstimator& before) noexcept {
    theta_N_ = std::clamp(before.theta_N_, theta_min_N_, theta_max_N_);
  }
  /// @param gain_phi  k(slip_ref) phi(slip), mean over the past interval
  /// @param switching  s of the past interval
  void update(double dt_s, double gain_phi, double switching) noexcept;

  [[nodiscard]] double theta_N() const noexcept { return theta_N_; }

 private:
  double gamma_;
  double theta0_N_;
  double theta_min_N_;
  double theta_max_N_;
  double theta_N_;
};

}  // namespace abs_hil::control

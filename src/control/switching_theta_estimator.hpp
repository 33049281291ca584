// The estimate of theta of the laws that slide on e_v = 0.
#pragma once

#include <type_traits>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// Estimator of the peak tyre force for a sliding-mode law,
///   theta_hat' = -gamma k(slip_ref) phi(slip) s,   where s in [-1, 1] is the substitute for sign(e_v),
/// projected onto [theta_min_N, theta_max_N]. If e_v' = -k phi (theta - theta_hat) - K s + d, then
/// V = |e_v| + (theta - theta_hat)^2/(2 gamma) falls at K - |d| or faster until e_v = 0, for either sign of phi
/// (docs/theory-baselines.md). Real-time safe.
template <class S>
class BasicSwitchingThetaEstimator {
 public:
  BasicSwitchingThetaEstimator() = default;
  /// Throws std::invalid_argument for a gain or bounds out of range.
  explicit BasicSwitchingThetaEstimator(const SwitchingAdaptationOptions& options)
    requires std::is_same_v<S, double>;

  void reset() noexcept { theta_N_ = theta0_N_; }
  /// Takes over the other's estimate, limited to the own bounds.
  void take_over(const BasicSwitchingThetaEstimator& before) noexcept {
    theta_N_ = rig::clamped(before.theta_N_, theta_min_N_, theta_max_N_);
  }
  /// @param gain_phi  k(slip_ref) phi(slip), mean over the past interval
  /// @param switching  s of the past interval
  /// @param where  elsewhere the estimate is held
  template <class Condition>
  void update(const Condition& where, const S& dt_s, const S& gain_phi, const S& switching) noexcept {
    const S theta_N = rig::clamped(S(theta_N_ - gamma_ * gain_phi * switching * dt_s), theta_min_N_, theta_max_N_);
    theta_N_ = rig::select(where, theta_N, theta_N_);
  }
  void update(const S& dt_s, const S& gain_phi, const S& switching) noexcept {
    update(dt_s == dt_s, dt_s, gain_phi, switching);
  }

  [[nodiscard]] S theta_N() const noexcept { return theta_N_; }

 private:
  S gamma_{0.0};
  S theta0_N_{0.0};
  S theta_min_N_{0.0};
  S theta_max_N_{0.0};
  S theta_N_{0.0};
};
using SwitchingThetaEstimator = BasicSwitchingThetaEstimator<double>;

}  // namespace abs_hil::control

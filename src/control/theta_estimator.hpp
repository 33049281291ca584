#pragma once

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// The interval between two control cycles, for the adaptation.
struct AdaptationInterval {
  double dt_s{0.0};                 ///< > 0
  double omega1_before_rad_s{0.0};  ///< upper wheel at its start ...
  double omega1_after_rad_s{0.0};   ///< ... and its end; linear in between
  double brake_torque_Nm{0.0};      ///< mean torque that acted
  double phi{0.0};                  ///< mean of phi(slip)
  double zeta_rate_N_s{0.0};        ///< mean of zeta' (17); counts for phi > 0 only
};

/// The same interval with a known tyre force.
struct ForceInterval {
  double dt_s{0.0};           ///< > 0
  double tyre_force_N{0.0};   ///< mean of F, see ThetaEstimator
  double phi{0.0};            ///< mean of phi(slip)
  double zeta_rate_N_s{0.0};  ///< as in AdaptationInterval
};

/// Estimate of the peak tyre force theta by (17)-(18): `omega1_hat_dot`, `zeta_dot` and `theta_hat` of paper_laws.hpp
/// in sampled-data form.
///
/// zeta and omega1_hat act on the controller through theta_hat alone, and (18) differentiated along (17) closes in it:
///   theta_hat' = zeta' + gamma ka1 (F - phi theta_hat),   F = (J1 omega1' + d1 omega1 + M10 + Tb)/r1,
/// where F is the tyre force computed from the upper wheel's motion. So the states here are zeta and theta_hat, and
/// omega1_hat follows from them by (18). This is the same estimator. Freezing (hold) and projection (clamp) act on
/// theta_hat directly, so they cause no wind-up and no jumps. The equation is linear. It is solved exactly for the
/// means of F, phi and zeta' over the interval, and so it is stable for any gain and rate.
///
/// Adaptation is frozen for phi <= 0 (rolling free, traction), where V' <= 0 of Theorem 3.1 does not hold, and while
/// the upper wheel stands, where its motion does not give F.
/// Real-time safe.
class ThetaEstimator {
 public:
  /// @param options  gamma, ka1, zeta0, theta_min_N <= theta_max_N; AdaptiveController checks them
  ThetaEstimator(const AdaptiveOptions& options, const rig::WheelParameters& wheels) noexcept;

  /// omega1_hat = omega1, so theta_hat = zeta0, projected.
  void reset() noexcept;
  /// Takes over the other's zeta, and its estimate, limited to the own bounds.
  void take_over(const ThetaEstimator& before) noexcept;
  void update(const AdaptationInterval& past) noexcept;
  void update(const ForceInterval& past) noexcept;

  [[nodiscard]] double theta_N() const noexcept { return theta_N_; }
  /// zeta of (17): the integral of zeta' from zeta0 while adaptation is not frozen, not projected.
  [[nodiscard]] double zeta_N() const noexcept { return zeta_N_; }
  /// omega1_hat of (17) at the end of the last interval, by (18). `omega1_rad_s` is the upper wheel's speed at that
  /// time.
  [[nodiscard]] double omega1_hat_rad_s(double omega1_rad_s) const noexcept;

 private:
  rig::WheelParameters wheels_;
  double innovation_gain_;  ///< gamma ka1
  double zeta0_N_;
  double theta_min_N_;
  double theta_max_N_;
  double theta_N_;
  double zeta_N_;
};

}  // namespace abs_hil::control

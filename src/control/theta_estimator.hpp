// The estimate of theta in (17), in sampled-data form with projection.
#pragma once

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// The interval between two control cycles, for the adaptation.
template <class S>
struct BasicAdaptationInterval {
  S dt_s{0.0};                 ///< > 0
  S omega1_before_rad_s{0.0};  ///< upper wheel at its start ...
  S omega1_after_rad_s{0.0};   ///< ... and its end; linear in between
  S brake_torque_Nm{0.0};      ///< mean torque that acted
  S phi{0.0};                  ///< mean of phi(slip)
  S zeta_rate_N_s{0.0};        ///< mean of zeta' (17); counts for phi > 0 only
};

/// The same interval with a known tyre force.
template <class S>
struct BasicForceInterval {
  S dt_s{0.0};           ///< > 0
  S tyre_force_N{0.0};   ///< mean of F, see ThetaEstimator
  S phi{0.0};            ///< mean of phi(slip)
  S zeta_rate_N_s{0.0};  ///< as in AdaptationInterval
};

using AdaptationInterval = BasicAdaptationInterval<double>;
using ForceInterval = BasicForceInterval<double>;

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
template <class S>
class BasicThetaEstimator {
 public:
  BasicThetaEstimator() = default;
  /// @param options  gamma, ka1, zeta0, theta_min_N <= theta_max_N; AdaptiveLaw checks them
  BasicThetaEstimator(const AdaptiveOptions& options, const rig::WheelParameters& wheels) noexcept
      : laws_{paper::laws(wheels)},
        innovation_gain_{options.gamma * options.ka1},
        zeta0_N_{rig::clamped(options.zeta0, options.theta_min_N, options.theta_max_N)},
        theta_min_N_{options.theta_min_N},
        theta_max_N_{options.theta_max_N},
        theta_N_{zeta0_N_},
        zeta_N_{zeta0_N_} {}

  /// omega1_hat = omega1, so theta_hat = zeta0, projected.
  void reset() noexcept {
    theta_N_ = zeta0_N_;
    zeta_N_ = zeta0_N_;
  }
  /// Takes over the other's zeta, and its estimate, limited to the own bounds.
  void take_over(const BasicThetaEstimator& before) noexcept {
    theta_N_ = rig::clamped(before.theta_N_, theta_min_N_, theta_max_N_);
    zeta_N_ = before.zeta_N_;
  }
  void update(const BasicAdaptationInterval<S>& past) noexcept;
  void update(const BasicForceInterval<S>& past) noexcept { update_where(past.dt_s > 0.0, past); }
  /// The same, but only where `known`: elsewhere the force is not.
  template <class Condition>
  void update_where(const Condition& known, const BasicForceInterval<S>& past) noexcept;

  [[nodiscard]] S theta_N() const noexcept { return theta_N_; }
  /// zeta of (17): the integral of zeta' from zeta0 while adaptation is not frozen, not projected.
  [[nodiscard]] S zeta_N() const noexcept { return zeta_N_; }
  /// omega1_hat of (17) at the end of the last interval, by (18). `omega1_rad_s` is the upper wheel's speed at that
  /// time.
  [[nodiscard]] S omega1_hat_rad_s(const S& omega1_rad_s) const noexcept {
    return omega1_rad_s - laws_.r1 / laws_.J1 * (theta_N_ - zeta_N_) / innovation_gain_;
  }

 private:
  paper::Laws<S> laws_{};
  S innovation_gain_{0.0};  ///< gamma ka1
  S zeta0_N_{0.0};
  S theta_min_N_{0.0};
  S theta_max_N_{0.0};
  S theta_N_{0.0};
  S zeta_N_{0.0};
};
using ThetaEstimator = BasicThetaEstimator<double>;

template <class S>
void BasicThetaEstimator<S>::update(const BasicAdaptationInterval<S>& past) noexcept {
  const auto known = past.dt_s > 0.0 && turns(past.omega1_before_rad_s) && turns(past.omega1_after_rad_s);
  if (!rig::any(known)) return;
  const auto& w = laws_;
  const S omega1_rate = (past.omega1_after_rad_s - past.omega1_before_rad_s) / past.dt_s;
  const S omega1_mean = 0.5 * (past.omega1_before_rad_s + past.omega1_after_rad_s);
  const S tyre_force_N = (w.J1 * omega1_rate + w.d1 * omega1_mean + w.M10 + past.brake_torque_Nm) / w.r1;
  update_where(known, {past.dt_s, tyre_force_N, past.phi, past.zeta_rate_N_s});
}

template <class S>
template <class Condition>
void BasicThetaEstimator<S>::update_where(const Condition& known, const BasicForceInterval<S>& past) noexcept {
  constexpr double least_decay = 1e-12;  // the quotient of two numbers below it loses its digits
  const auto adapts = known && past.phi > 0.0;
  if (!rig::any(adapts)) return;
  // theta' = rate_now - decay (theta - theta_now): over dt it covers (1 - exp(-decay dt))/decay of the present rate.
  const S rate_now = past.zeta_rate_N_s + innovation_gain_ * (past.tyre_force_N - past.phi * theta_N_);
  const S decay = innovation_gain_ * past.phi;
  const S share = decay * past.dt_s;
  // For a decay that vanishes, that is dt.
  const S covered_s =
      rig::select(rig::magnitude(share) < least_decay, past.dt_s, S(-rig::exponential_less_one(S(-share)) / decay));
  const S theta_N = rig::clamped(S(theta_N_ + covered_s * rate_now), theta_min_N_, theta_max_N_);
  theta_N_ = rig::select(adapts, theta_N, theta_N_);
  zeta_N_ = rig::select(adapts, S(zeta_N_ + past.zeta_rate_N_s * past.dt_s), zeta_N_);
}

}  // namespace abs_hil::control

// What the laws that slide on e_v = 0 have in common: the estimate of theta and the equivalent control.
#pragma once

#include <stdexcept>

#include "abs_hil/control/equivalent_control.hpp"
#include "abs_hil/control/options.hpp"
#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
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
  explicit BasicSwitchingThetaEstimator(const SwitchingAdaptationOptions<>& options)
      : options_{options}, theta_N_{options.theta0_N} {
    rig::require_valid(options, "");
    if (!(options.theta_min_N <= options.theta0_N && options.theta0_N <= options.theta_max_N)) {
      throw std::invalid_argument("theta0_N must be in [theta_min_N, theta_max_N]");
    }
  }

  void reset() noexcept { theta_N_ = options_.theta0_N; }
  /// Takes over the other's estimate, limited to the own bounds.
  void take_over(const BasicSwitchingThetaEstimator& before) noexcept {
    theta_N_ = rig::clamped(before.theta_N_, options_.theta_min_N, options_.theta_max_N);
  }
  /// @param gain_phi  k(slip_ref) phi(slip), mean over the past interval
  /// @param switching  s of the past interval
  /// @param where  elsewhere the estimate is held
  template <class Condition>
  void update(const Condition& where, const S& dt_s, const S& gain_phi, const S& switching) noexcept {
    const S theta_N = rig::clamped(S(theta_N_ - options_.gamma * gain_phi * switching * dt_s), options_.theta_min_N,
                                   options_.theta_max_N);
    theta_N_ = rig::select(where, theta_N, theta_N_);
  }
  void update(const S& dt_s, const S& gain_phi, const S& switching) noexcept {
    update(dt_s == dt_s, dt_s, gain_phi, switching);
  }

  [[nodiscard]] S theta_N() const noexcept { return theta_N_; }

 private:
  SwitchingAdaptationOptions<S> options_{};
  S theta_N_{0.0};
};
using SwitchingThetaEstimator = BasicSwitchingThetaEstimator<double>;

/// The common part of the laws that slide on e_v = 0: the equivalent control and an estimate theta_hat. A law gives the
/// reference motion of e_v and its substitute for sign(e_v). Real-time safe except the constructor.
template <class S>
class BasicSlidingSurface {
 public:
  BasicSlidingSurface() = default;
  /// Throws std::invalid_argument for options out of range.
  BasicSlidingSurface(const ControllerContext& context, const SwitchingAdaptationOptions<>& adaptation)
      : laws_{paper::laws(context.rig.wheels)}, tyre_{context.rig.tyre}, equivalent_{context}, theta_{adaptation} {}

  void reset(const BasicSlipInput<S>& input) noexcept {
    theta_.reset();
    slip_ = input.slip;
    switching_ = S(0.0);
    excess_ = S(0.0);
  }
  /// Takes over the state of the other.
  void take_over(const BasicSlidingSurface& before) noexcept {
    theta_.take_over(before.theta_);
    slip_ = before.slip_;
    past_phi_ = before.past_phi_;
    switching_ = before.switching_;
    excess_ = before.excess_;
  }
  /// Adapts theta_hat over the past interval. theta_hat is held if the torque sent was not the reference torque and
  /// adaptation would drive the two further apart (anti-windup).
  /// @return e_v now
  [[nodiscard]] S observe(const BasicSlipInput<S>& input) noexcept;
  /// The torque that moves e_v, now `error_m_s`, along the reference motion.
  /// @param switching  s for theta_hat over the coming interval, in [-1, 1]
  [[nodiscard]] BasicSlipOutput<S> drive(const BasicSlipInput<S>& input, const S& error_m_s,
                                         const BasicWantedMotion<S>& wanted, const S& switching) noexcept;

  /// True if the last torque is not sent as it is and a change of this sign would drive it further out.
  [[nodiscard]] auto winds_up(const S& torque_change) const noexcept { return excess_ * torque_change > 0.0; }
  [[nodiscard]] S period_s() const noexcept { return equivalent_.period_s(); }

 private:
  paper::Laws<S> laws_{};
  rig::TyreShape<S> tyre_{};
  BasicEquivalentControl<S> equivalent_{};
  BasicSwitchingThetaEstimator<S> theta_{};
  S slip_{0.0};  ///< of the previous cycle
  S past_phi_{0.0};
  S switching_{0.0};
  S excess_{0.0};  ///< > 0: less is sent than the reference torque, < 0: more is sent, 0: neither
};

template <class S>
S BasicSlidingSurface<S>::observe(const BasicSlipInput<S>& input) noexcept {
  past_phi_ = rig::normalised_tyre_force(tyre_, S(0.5 * (slip_ + input.slip)));
  slip_ = input.slip;
  excess_ = input.unsent_torque_Nm;
  // theta_hat changes by -phi s, and the torque by phi times this change.
  const S gain_phi = laws_.k({.lambda_ref = input.slip_ref}) * past_phi_;
  theta_.update(!winds_up(S(-switching_)), input.dt_s, gain_phi, switching_);
  return slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref);
}

template <class S>
BasicSlipOutput<S> BasicSlidingSurface<S>::drive(const BasicSlipInput<S>& input, const S& error_m_s,
                                                 const BasicWantedMotion<S>& wanted, const S& switching) noexcept {
  const S torque_Nm = equivalent_.brake_torque_Nm(input, error_m_s, wanted, theta_.theta_N(), past_phi_);
  switching_ = switching;
  // A torque outside the actuator's range will not be sent, and a limit that held in the past cycle may still hold.
  const auto outside = torque_Nm > input.max_brake_torque_Nm || torque_Nm < 0.0;
  excess_ = rig::select(outside, torque_Nm, excess_);
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta_.theta_N()};
}

}  // namespace abs_hil::control

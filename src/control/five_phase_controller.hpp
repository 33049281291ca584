// Production-style anti-lock logic on thresholds of the wheel's acceleration.
#pragma once

#include <cstdint>
#include <limits>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/classic_controllers.hpp"
#include "control/law_controller.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// State of the cycle of FivePhaseLaw.
enum class BrakePhase : std::uint8_t {
  apply,    ///< first application: the torque rises fast
  hold,     ///< the wheel decelerates more than a car can: the torque is held
  release,  ///< it decelerates even more: the torque falls
  recover,  ///< the wheel accelerates: the torque is held until it has recovered
  reapply,  ///< the torque rises slowly until the next instability
};

/// Anti-lock logic on thresholds of the braked wheel's acceleration a = r1 omega1', as in production systems (the cycle
/// of the Bosch Automotive Handbook; five-phase algorithms after Pasillas-Lepine, 2006). It measures no slip:
/// apply -> hold (a < hold_below) -> release (a < release_below) -> recover (a > recover_above) -> re-apply (a, once
/// above reapply_below, < reapply_below) -> hold ... From hold it re-applies when a is back above hold_below, or
/// after hold_limit_s without a transition. A standing wheel counts as one that decelerates without bound, because
/// nothing else distinguishes a locked wheel from a free one here. The controller reads alpha1, omega1 and the torque's
/// limit only. It reports the slip velocity error for the record. theta_est_N is NaN.
template <class S>
class FivePhaseLaw {
 public:
  static constexpr bool estimates_theta = false;

  FivePhaseLaw() = default;
  /// Throws std::invalid_argument if thresholds are out of order or a ramp or limit is not > 0.
  explicit FivePhaseLaw(const ControllerContext& context)
      : laws_{paper::laws(context.rig.wheels)},
        brake_{context.rig.brake},
        options_{context.options.five_phase},
        period_s_{1.0 / context.options.rate_Hz} {
    rig::require_valid(options_, "control.five_phase.");
    if (!(options_.release_below_m_s2 <= options_.hold_below_m_s2)) {
      throw std::invalid_argument("control.five_phase.release_below_m_s2 must not be above hold_below_m_s2");
    }
    if (!(options_.recover_above_m_s2 > options_.release_below_m_s2)) {
      throw std::invalid_argument("control.five_phase.recover_above_m_s2 must be above release_below_m_s2");
    }
    if (!(options_.reapply_below_m_s2 > options_.hold_below_m_s2)) {
      throw std::invalid_argument("control.five_phase.reapply_below_m_s2 must be above hold_below_m_s2");
    }
    if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
  }

  void reset(const BasicSlipInput<S>& /*input*/) noexcept {
    phase_ = number(BrakePhase::apply);
    in_phase_s_ = at_zero_s_ = accelerated_ = torque_Nm_ = S(0.0);
  }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  void take_over(const FivePhaseLaw& before) noexcept {
    phase_ = before.phase_;
    in_phase_s_ = before.in_phase_s_;
    at_zero_s_ = before.at_zero_s_;
    accelerated_ = before.accelerated_;
    torque_Nm_ = before.torque_Nm_;
  }

  [[nodiscard]] BrakePhase phase() const noexcept { return static_cast<BrakePhase>(phase_); }

 private:
  static S number(BrakePhase phase) noexcept { return S(static_cast<double>(phase)); }
  [[nodiscard]] auto in(BrakePhase phase) const noexcept { return phase_ == number(phase); }
  /// @param a_m_s2  acceleration of the wheel
  [[nodiscard]] S next_phase(const S& a_m_s2) const noexcept;
  [[nodiscard]] S ramp_Nm_s() const noexcept;

  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  FivePhaseOptions<S> options_{};
  S period_s_{0.0};
  S phase_{0.0};  ///< the number of a BrakePhase
  S in_phase_s_{0.0};
  S at_zero_s_{0.0};    ///< since the torque reached 0 in `release`
  S accelerated_{0.0};  ///< 1 in `recover` once the acceleration has been above reapply_below, else 0
  S torque_Nm_{0.0};
};

template <class S>
S FivePhaseLaw<S>::next_phase(const S& a_m_s2) const noexcept {
  using enum BrakePhase;
  const auto unstable = a_m_s2 < options_.hold_below_m_s2;
  const auto held_long = in_phase_s_ >= options_.hold_limit_s;
  const auto recovered =
      (accelerated_ > 0.0 && a_m_s2 < options_.reapply_below_m_s2) || in_phase_s_ >= options_.recover_limit_s;
  const auto turned = a_m_s2 > options_.recover_above_m_s2 || at_zero_s_ >= options_.recover_limit_s;

  const S from_apply = rig::select(unstable, number(hold), phase_);
  const S from_hold = rig::select(a_m_s2 < options_.release_below_m_s2, number(release),
                                  rig::select(!unstable || held_long, number(reapply), phase_));
  const S from_release = rig::select(turned, number(recover), phase_);
  const S from_recover = rig::select(unstable, number(hold), rig::select(recovered, number(reapply), phase_));
  return rig::select(in(hold), from_hold,
                     rig::select(in(release), from_release, rig::select(in(recover), from_recover, from_apply)));
}

template <class S>
S FivePhaseLaw<S>::ramp_Nm_s() const noexcept {
  using enum BrakePhase;
  return rig::select(
      in(apply), options_.apply_Nm_s,
      rig::select(in(release), S(-options_.release_Nm_s), rig::select(in(reapply), options_.reapply_Nm_s, S(0.0))));
}

template <class S>
BasicSlipOutput<S> FivePhaseLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  const S unbounded_m_s2 = S(-std::numeric_limits<double>::infinity());
  const S acceleration_m_s2 =
      rig::select(turns(input.speeds.omega1_rad_s), S(laws_.r1 * input.alpha1_rad_s2), unbounded_m_s2);
  const auto accelerates = acceleration_m_s2 > options_.reapply_below_m_s2;
  in_phase_s_ += input.dt_s;
  at_zero_s_ = rig::select(torque_Nm_ > 0.0, S(0.0), S(at_zero_s_ + input.dt_s));
  accelerated_ = rig::select(accelerates, S(1.0), accelerated_);

  const S next = next_phase(acceleration_m_s2);
  const auto changes = next != phase_;
  phase_ = next;
  in_phase_s_ = rig::select(changes, S(0.0), in_phase_s_);
  accelerated_ = rig::select(changes, rig::select(accelerates, S(1.0), S(0.0)), accelerated_);
  // A ramp goes on from what was sent, not from what a limit held back.
  torque_Nm_ = rig::select(input.unsent_torque_Nm != 0.0, input.sent_brake_torque_Nm, torque_Nm_);
  // The torque is held for the next period, so it gets the ramp's value at the period's end.
  const S step_s = rig::select(input.dt_s > 0.0, input.dt_s, period_s_);
  torque_Nm_ =
      rig::clamped(S(torque_Nm_ + ramp_Nm_s() * step_s), S(0.0), full_torque_Nm(brake_, input.max_brake_torque_Nm));
  return {.brake_torque_Nm = torque_Nm_,
          .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

}  // namespace abs_hil::control

// PI on a sum of slip and wheel deceleration.
#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "control/full_torque.hpp"
#include "control/law_controller.hpp"
#include "control/standing_wheel.hpp"

namespace abs_hil::control {

/// Mixed slip-deceleration control (Savaresi, Tanelli and Cantoni, 2007): a PI controller holds
///   slip + weight * (deceleration of the upper wheel's circumference in g)
/// at one value. With a constant wheel slip the wheel decelerates as the car does, so the held slip is smaller where
/// the tyre grips more. The deceleration also answers a torque at once, and damps the loop. It estimates nothing.
/// A standing wheel has slip 1 and no deceleration. theta_est_N is NaN.
template <class S>
class MixedSlipDecelerationLaw {
 public:
  static constexpr bool estimates_theta = false;

  MixedSlipDecelerationLaw() = default;
  /// Throws std::invalid_argument for options out of range.
  explicit MixedSlipDecelerationLaw(const ControllerContext& context)
    requires std::is_same_v<S, double>;

  void reset(const BasicSlipInput<S>& /*input*/) noexcept { integral_Nm_ = S(0.0); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  void take_over(const MixedSlipDecelerationLaw& before) noexcept { integral_Nm_ = before.integral_Nm_; }

 private:
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  S weight_{0.0};
  S target_{0.0};
  S kp_Nm_{0.0};
  S ki_Nm_s_{0.0};
  S integral_Nm_{0.0};
};

template <class S>
BasicSlipOutput<S> MixedSlipDecelerationLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  constexpr double g_m_s2 = 9.81;
  const S deceleration =
      rig::select(turns(input.speeds.omega1_rad_s), S(-laws_.r1 * input.alpha1_rad_s2 / g_m_s2), S(0.0));
  const S error = target_ - (input.slip + weight_ * deceleration);
  const S full_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm);
  // Where less was sent than asked for, the integral must not grow, and the other way round.
  const S integral_Nm = rig::clamped(S(integral_Nm_ + ki_Nm_s_ * error * input.dt_s), S(0.0), full_Nm);
  integral_Nm_ = rig::select(input.unsent_torque_Nm * error > 0.0, integral_Nm_, integral_Nm);
  return {.brake_torque_Nm = rig::clamped(S(kp_Nm_ * error + integral_Nm_), S(0.0), full_Nm),
          .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

class MixedSlipDecelerationController final : public LawController<MixedSlipDecelerationLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control

#pragma once

#include "abs_hil/control/equivalent_control.hpp"
#include "control/switching_theta_estimator.hpp"

namespace abs_hil::control {

/// The common part of the laws that slide on e_v = 0: the equivalent control and an estimate theta_hat. A law gives the
/// reference motion of e_v and its substitute for sign(e_v). Real-time safe except the constructor.
class SlidingSurface {
 public:
  /// Throws std::invalid_argument for options out of range.
  SlidingSurface(const ControllerContext& context, const SwitchingAdaptationOptions& adaptation);

  void reset(const SlipInput& input) noexcept;
  /// Takes over the state of the other.
  void take_over(const SlidingSurface& before) noexcept;
  /// Adapts theta_hat over the past interval. theta_hat is held if the torque sent was not the reference torque and
  /// adaptation would drive the two further apart (anti-windup).
  /// @return e_v now
  [[nodiscard]] double observe(const SlipInput& input) noexcept;
  /// The torque that moves e_v, now `error_m_s`, along the reference motion.
  /// @param switching  s for theta_hat over the coming interval, in [-1, 1]
  [[nodiscard]] SlipOutput drive(const SlipInput& input, double error_m_s, const WantedMotion& wanted,
                                 double switching) noexcept;

  /// True if the last torque is not sent as it is and a change of this sign would drive it further out.
  [[nodiscard]] bool winds_up(double torque_change) const noexcept { return excess_ * torque_change > 0.0; }
  [[nodiscard]] double period_s() const noexcept { return equivalent_.period_s(); }

 private:
  rig::WheelParameters wheels_;
  rig::TyreParameters tyre_;
  EquivalentControl equivalent_;
  SwitchingThetaEstimator theta_;
  double slip_{0.0};  ///< of the previous cycle
  double past_phi_{0.0};
  double switching_{0.0};
  double excess_{0.0};  ///< > 0: less is sent than the reference torque, < 0: more is sent, 0: neither
};

}  // namespace abs_hil::control

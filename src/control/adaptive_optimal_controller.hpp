// Brakes at the unknown peak of friction with as little motion of the brake as possible.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/friction_bank.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Torque that brings e_v' = (r1/J1) (T - hold) to e_v = 0 with a brake that is slow: near the target in proportion to
/// the error, far from it almost as fast as the brake can (proximate time-optimal control, Workman 1987). While the
/// torque returns to `hold` at the rate a, the error moves on by z^2 / (2 a J1/r1) for an excess z. So z =
/// sqrt(2 a (J1/r1) |e|) is the largest excess from which the error still ends at 0.
struct ProximateTorque {
  double mass_kg_m{0.0};        ///< J1/r1
  double gain_per_s{0.0};       ///< decay of a large error
  double near_per_s{0.0};       ///< decay of a small error
  double near_m_s{0.0};         ///< error at which the gain is half way between; > 0
  double swing_per_s{0.0};      ///< the brake's c31
  double rate_limit_Nm_s{0.0};  ///< of the brake; may be infinite

  /// Excess over the holding torque, as a size.
  /// @param error_m_s  size of e_v
  /// @param room_Nm  from the holding torque to the end of the range that the torque must use to return, > 0
  /// @param authority  part of the limit that is used, in (0, 1]
  [[nodiscard]] double excess_Nm(double error_m_s, double room_Nm, double authority) const noexcept {
    const double gain = near_per_s + (gain_per_s - near_per_s) * error_m_s / (error_m_s + near_m_s);
    const double rate = std::min(swing_per_s * room_Nm, rate_limit_Nm_s);
    return std::min(gain * mass_kg_m * error_m_s, authority * std::sqrt(2.0 * rate * mass_kg_m * error_m_s));
  }
};

/// Brakes at the slip of the largest tyre force, and moves the brake as little as that allows. It needs neither theta,
/// B and C nor a slip reference (docs/theory-beyond.md). FrictionBank learns the curve from the lower wheel's force.
/// The torque that holds a slip follows from the curve and from the error that the balance of both wheels shows. The
/// loop is proximate time-optimal through the brake's lag and rate limit. Changes below `play_Nm` are not sent. It does
/// not use `rig.tyre`. theta_est_N is the estimated peak force, and slip_ref is the controller's own reference.
class AdaptiveOptimalController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit AdaptiveOptimalController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override;
  [[nodiscard]] std::vector<Learnt> learnt() const override;
  [[nodiscard]] bool exchange_state(rig::StateBytes& state) override;

 private:
  /// The torques that hold the slip: as it is wanted, and as it is.
  struct Holding {
    double wanted_Nm;
    double here_Nm;
  };

  /// Cycles since the bank last learnt.
  struct Unlearnt {
    int cycles{0};
    double time_s{0.0};
    double upper_rad{0.0}, lower_rad{0.0};  ///< travel of both wheels
  };

  [[nodiscard]] double slip_of(const rig::WheelSpeeds& speeds) const noexcept;
  void learn(const SlipInput& input, double slip) noexcept;
  [[nodiscard]] FrictionBank::Swing swing(double disc_error_rad, double omega_rad_s) const noexcept;
  [[nodiscard]] double peak_factor() const noexcept;
  [[nodiscard]] double near_gain_per_s() const noexcept;
  [[nodiscard]] double next_reference(double dt_s) noexcept;
  [[nodiscard]] double holding_torque_Nm(const rig::WheelSpeeds& speeds, double slip, double force_N) const noexcept;
  [[nodiscard]] Holding holding(double slip, double reference, double error_m_s) const noexcept;
  [[nodiscard]] double wanted_torque_Nm(const Holding& hold, double error_m_s, double most_Nm) const noexcept;
  [[nodiscard]] double through_lag_Nm(double torque_Nm, double wanted_Nm) const noexcept;
  [[nodiscard]] double with_play_Nm(double torque_Nm, double most_Nm) noexcept;

  AdaptiveOptimalOptions options_;
  rig::RigParameters rig_;
  paper::Laws<double> laws_;
  BrakeLag lag_;
  double period_s_;
  double v_min_m_s_;
  ProximateTorque loop_;
  WheelForceObserver observer_;
  LowerWheelForce force_;
  DelayedSpeeds speeds_;
  int learns_every_;  ///< cycles
  FrictionBank bank_;
  double reference_{0.0};       ///< slip of the peak, without search and zero
  double model_error_Nm_{0.0};  ///< of the holding torque: what is missing in it
  double sent_Nm_{0.0};
  double search_rad_{0.0};  ///< angle of the search, in [-pi, pi]
  rig::WheelSpeeds last_speeds_{};
  Unlearnt unlearnt_;
};

}  // namespace abs_hil::control

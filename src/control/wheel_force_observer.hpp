#pragma once

#include <Eigen/Core>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// Estimates the speeds of both wheels and the tyre force between them from both encoders and the modelled brake
/// torque. It is a steady-state Kalman filter on (1)-(2),
///   J1 omega1' = r1 F - d1 omega1 - M10 - (Tb + D),   J2 omega2' = -r2 F - d2 omega2 - M20,   F' = noise,  D' = noise,
/// measured by the two angles with the error of a count. It uses no tyre model: F is an unknown input to both wheels,
/// and D is the error of the brake model, which acts on the upper wheel only. Tb is fed forward, so the speeds do not
/// lag when the brake torque changes. Gains are computed once, for the nominal rate. `reset` and `update` are real-time
/// safe.
class WheelForceObserver {
 public:
  /// @param rate_Hz  control cycles per second, > 0, for the gains; the prediction uses the measured interval
  /// Throws std::invalid_argument for options not > 0.
  WheelForceObserver(const ForceObserverOptions& options, const rig::RigParameters& rig, double rate_Hz);

  /// Starts from these speeds with zero force.
  void reset(const rig::WheelSpeeds& speeds) noexcept;
  /// Takes over the other's estimates.
  void take_over(const WheelForceObserver& before) noexcept {
    state_ = before.state_;
    last_speeds_ = before.last_speeds_;
  }
  /// Updates by one interval. If the travel is unknown, `input.speeds` give it.
  void update(const SlipInput& input) noexcept;

  [[nodiscard]] rig::WheelSpeeds speeds() const noexcept { return {state_[omega1], state_[omega2]}; }
  [[nodiscard]] double force_N() const noexcept { return state_[force]; }
  /// Error of the actuator's model: acting minus modelled brake torque, N m.
  [[nodiscard]] double brake_error_Nm() const noexcept { return state_[brake_error]; }
  /// Time by which `force_N` follows a ramp of the force, s.
  [[nodiscard]] double force_delay_s() const noexcept { return force_delay_s_; }

 private:
  using State = Eigen::Matrix<double, 6, 1>;
  enum Index : Eigen::Index { angle1, omega1, angle2, omega2, force, brake_error };

  void predict(double dt_s, double brake_torque_Nm) noexcept;

  rig::WheelParameters wheels_;
  Eigen::Matrix<double, 6, 2> gain_;
  double force_delay_s_;
  State state_{State::Zero()};  ///< angles: estimate minus reading
  rig::WheelSpeeds last_speeds_{};
};

}  // namespace abs_hil::control

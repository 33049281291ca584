// An observer of both wheels, the tyre force and the brake's error.
#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/control/options.hpp"
#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// How large a rig's forces are, against those of the paper's rig, for which gains that carry units were chosen. Wheels
/// decelerate by much the same m/s^2 on every rig, so forces are in proportion to the mass J2/r2^2 that the
/// lower wheel stands for, and torques to that times r1. Both are exactly 1 for the paper's wheels.
struct RigScale {
  double force{1.0};
  double torque{1.0};
};
[[nodiscard]] constexpr RigScale rig_scale(const rig::WheelParameters& w) noexcept {
  const rig::WheelParameters paper{};
  const double force = (w.J2_kg_m2 / (w.r2_m * w.r2_m)) / (paper.J2_kg_m2 / (paper.r2_m * paper.r2_m));
  return {.force = force, .torque = force * (w.r1_m / paper.r1_m)};
}

/// Estimates the speeds of both wheels and the tyre force between them from both encoders and the modelled brake
/// torque. It is a steady-state Kalman filter on (1)-(2),
///   J1 omega1' = r1 F - d1 omega1 - M10 - (Tb + D),   J2 omega2' = -r2 F - d2 omega2 - M20,   F' = noise,  D' = noise,
/// measured by the two angles with the error of a count. It uses no tyre model: F is an unknown input to both wheels,
/// and D is the error of the brake model, which acts on the upper wheel only. Tb is fed forward, so the speeds do not
/// lag when the brake torque changes. Gains are computed once, for the nominal rate. `reset` and `update` are real-time
/// safe.
template <class S>
class BasicWheelForceObserver {
 public:
  BasicWheelForceObserver() = default;
  /// @param rate_Hz  control cycles per second, > 0, for the gains; the prediction uses the measured interval
  /// Throws std::invalid_argument for options not > 0.
  BasicWheelForceObserver(const ForceObserverOptions<>& options, const rig::RigParameters& rig, double rate_Hz);

  /// Starts from these speeds with zero force.
  void reset(const rig::BasicWheelSpeeds<S>& speeds) noexcept;
  /// Takes over the other's estimates.
  void take_over(const BasicWheelForceObserver& before) noexcept {
    state_ = before.state_;
    last_speeds_ = before.last_speeds_;
  }
  /// Updates by one interval. If the travel is unknown, `input.speeds` give it.
  void update(const BasicSlipInput<S>& input) noexcept;

  [[nodiscard]] rig::BasicWheelSpeeds<S> speeds() const noexcept { return {state_[omega1], state_[omega2]}; }
  [[nodiscard]] S force_N() const noexcept { return state_[force]; }
  /// Error of the actuator's model: acting minus modelled brake torque, N m.
  [[nodiscard]] S brake_error_Nm() const noexcept { return state_[brake_error]; }
  /// Time by which `force_N` follows a ramp of the force, s.
  [[nodiscard]] S force_delay_s() const noexcept { return force_delay_s_; }

 private:
  using State = std::array<S, 6>;
  enum Index : std::size_t { angle1, omega1, angle2, omega2, force, brake_error };

  void predict(const S& dt_s, const S& brake_torque_Nm) noexcept;

  paper::Laws<S> laws_{};
  State upper_gain_{};  ///< on the residual of the upper wheel's angle
  State lower_gain_{};
  S force_delay_s_{0.0};
  State state_{};  ///< angles: estimate minus reading
  rig::BasicWheelSpeeds<S> last_speeds_{};
};
using WheelForceObserver = BasicWheelForceObserver<double>;

template <class S>
void BasicWheelForceObserver<S>::reset(const rig::BasicWheelSpeeds<S>& speeds) noexcept {
  state_ = State{};
  state_[omega1] = speeds.omega1_rad_s;
  state_[omega2] = speeds.omega2_rad_s;
  last_speeds_ = speeds;
}

template <class S>
void BasicWheelForceObserver<S>::predict(const S& dt_s, const S& brake_torque_Nm) noexcept {
  const auto& w = laws_;
  const S alpha1 =
      (w.r1 * state_[force] - w.d1 * state_[omega1] - w.M10 - brake_torque_Nm - state_[brake_error]) / w.J1;
  const S alpha2 = (-w.r2 * state_[force] - w.d2 * state_[omega2] - w.M20) / w.J2;
  // The brake stops a wheel but cannot turn it backwards.
  const S omega1_after = rig::larger(S(0.0), S(state_[omega1] + alpha1 * dt_s));
  const S omega2_after = rig::larger(S(0.0), S(state_[omega2] + alpha2 * dt_s));
  state_[angle1] += 0.5 * (state_[omega1] + omega1_after) * dt_s;
  state_[angle2] += 0.5 * (state_[omega2] + omega2_after) * dt_s;
  state_[omega1] = omega1_after;
  state_[omega2] = omega2_after;
}

template <class S>
void BasicWheelForceObserver<S>::update(const BasicSlipInput<S>& input) noexcept {
  const auto later = input.dt_s > 0.0;
  if (!rig::any(later)) return;
  const auto unknown = rig::is_nan(input.upper_travel_rad) || rig::is_nan(input.lower_travel_rad);
  const auto& last = last_speeds_;
  const S upper_rad = rig::select(unknown, S(0.5 * (last.omega1_rad_s + input.speeds.omega1_rad_s) * input.dt_s),
                                  input.upper_travel_rad);
  const S lower_rad = rig::select(unknown, S(0.5 * (last.omega2_rad_s + input.speeds.omega2_rad_s) * input.dt_s),
                                  input.lower_travel_rad);
  last_speeds_ = input.speeds;

  predict(input.dt_s, input.mean_brake_torque_Nm);
  const S upper_residual = upper_rad - state_[angle1];
  const S lower_residual = lower_rad - state_[angle2];
  for (std::size_t i = 0; i < state_.size(); ++i) {
    state_[i] += upper_gain_[i] * upper_residual + lower_gain_[i] * lower_residual;
  }
  state_[angle1] -= upper_rad;
  state_[angle2] -= lower_rad;
  state_[omega1] = rig::larger(S(0.0), state_[omega1]);
  state_[omega2] = rig::larger(S(0.0), state_[omega2]);
}

}  // namespace abs_hil::control

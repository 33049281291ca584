// The right-hand side of the wheels' and the brake's differential equations (1), (2) and (6):
//
//   J1 omega1' = r1 F - d1 omega1 - s1 (M10 + M),   J2 omega2' = -r2 F - d2 omega2 - s2 M20 + A u (1 - omega2 / w0)
//   Tb' = c31 (b - Tb), within the limit of the rate;   M = Tb + R cos(theta1 + phase) min(Tb / 3 N m, 1)
//
// F is the tyre force, u the motor's duty, A its stall torque, w0 its no-load speed, b the target of the brake torque
// Tb, M the torque that acts on the wheel, R the ripple.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <type_traits>

#include "abs_hil/plant_sim/plant.hpp"
#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::plant_sim {

/// The plant's state; the indices below name its elements. `S` is a `double`, or a pack of them (rig/scalar.hpp).
template <class S>
using BasicState = std::array<S, 5>;
using StateVector = BasicState<double>;
inline constexpr std::size_t omega1 = 0;
inline constexpr std::size_t omega2 = 1;
inline constexpr std::size_t brake_torque = 2;
inline constexpr std::size_t angle1 = 3;
inline constexpr std::size_t angle2 = 4;

[[nodiscard]] inline StateVector vector_of(const PlantState& state) noexcept {
  StateVector x{};
  x[omega1] = state.omega1_rad_s;
  x[omega2] = state.omega2_rad_s;
  x[brake_torque] = state.brake_torque_Nm;
  x[angle1] = state.angle1_rad;
  x[angle2] = state.angle2_rad;
  return x;
}
[[nodiscard]] inline PlantState state_of(const StateVector& x) noexcept {
  return {x[angle1], x[angle2], x[omega1], x[omega2], x[brake_torque]};
}

/// Direction of sliding of each wheel in its bearing and brake: +1 forward, -1 backward, 0 held at standstill. It is
/// fixed within a substep, so that the right-hand side is smooth there.
struct Sliding {
  double upper{0.0};
  double lower{0.0};
};

/// Both wheels, in the form that the differential equations use.
template <class S>
struct BasicWheels {
  S r1_m{0.0}, r2_m{0.0};
  S per_J1{0.0}, per_J2{0.0};  ///< reciprocal moments of inertia
  S r1_per_J1{0.0}, r2_per_J2{0.0};
  S d1_Nms_rad{0.0}, d2_Nms_rad{0.0};
  S M10_Nm{0.0}, M20_Nm{0.0};

  BasicWheels() = default;
  explicit BasicWheels(const rig::WheelParameters& w) noexcept
      : r1_m(w.r1_m),
        r2_m(w.r2_m),
        per_J1(1.0 / w.J1_kg_m2),
        per_J2(1.0 / w.J2_kg_m2),
        r1_per_J1(r1_m * per_J1),
        r2_per_J2(r2_m * per_J2),
        d1_Nms_rad(w.d1_Nms_rad),
        d2_Nms_rad(w.d2_Nms_rad),
        M10_Nm(w.M10_Nm),
        M20_Nm(w.M20_Nm) {}

  // Each rate needs the force last, because the force takes longest.
  /// omega1' of (1).
  template <class Direction>
  [[nodiscard]] S upper_rate_rad_s2(const S& force_N, const S& brake_Nm, const S& omega1_rad_s,
                                    Direction sliding) const noexcept {
    return r1_per_J1 * force_N - (d1_Nms_rad * omega1_rad_s + sliding * (M10_Nm + brake_Nm)) * per_J1;
  }
  /// omega2' of (2).
  template <class Direction>
  [[nodiscard]] S lower_rate_rad_s2(const S& force_N, const S& motor_Nm, const S& omega2_rad_s,
                                    Direction sliding) const noexcept {
    return (motor_Nm - d2_Nms_rad * omega2_rad_s - sliding * M20_Nm) * per_J2 - r2_per_J2 * force_N;
  }
};

/// The inputs of one `advance` in the form that the differential equations use.
template <class S>
struct BasicHeldTorques {
  S brake_target_Nm{0.0};   ///< b(u) of (7), the target of the brake torque
  S brake_rate_per_s{0.0};  ///< c31 of (6); 0 for the ideal actuator, whose torque is constant
  S brake_limit_Nm_s{std::numeric_limits<double>::infinity()};  ///< of the torque's rate
  S motor_stall_Nm{0.0};                                        ///< motor torque at standstill
  S motor_back_emf_Nms{0.0};  ///< decrease of the motor torque per rad/s of the lower wheel
  double ripple_Nm{0.0};      ///< of the brake torque over the upper wheel's angle; lanes have none
  double ripple_phase_rad{0.0};
};
using HeldTorques = BasicHeldTorques<double>;

/// @param omega2_rad_s  decides which start resistors are in the motor's circuit
inline void set_motor(HeldTorques& held, const rig::DriveMotorParameters& motor, double duty,
                      double omega2_rad_s) noexcept {
  held.motor_stall_Nm = rig::stall_torque_Nm(motor, omega2_rad_s) * duty;
  held.motor_back_emf_Nms = held.motor_stall_Nm / motor.no_load_speed_rad_s;
}

[[nodiscard]] inline HeldTorques resolve(const PlantOptions& options, const PlantInput& input,
                                         double omega2_rad_s = 0.0) noexcept {
  const rig::RigParameters& rig = options.rig;
  HeldTorques held;
  if (options.ideal_actuator) {
    held.brake_target_Nm = input.brake_torque_Nm;
  } else {
    held.brake_target_Nm = rig::brake_torque_at(rig.brake, input.brake_duty);
    held.brake_rate_per_s = rig.brake.c31_per_s;
    if (rig.brake.brake_rate_limit_Nm_s > 0.0) held.brake_limit_Nm_s = rig.brake.brake_rate_limit_Nm_s;
    held.ripple_Nm = options.brake_flaws.ripple_Nm;
    held.ripple_phase_rad = options.brake_flaws.ripple_phase_rad;
  }
  set_motor(held, rig.motor, input.motor_duty, omega2_rad_s);
  return held;
}

/// The same without the motor.
template <class S>
struct BrakeAlone {
  S brake_target_Nm{0.0};
  S brake_rate_per_s{0.0};
};
template <class S>
[[nodiscard]] inline S motor_torque_Nm(const BrakeAlone<S>& /*held*/, const S& /*omega2_rad_s*/) noexcept {
  return S(0.0);
}

/// Torque of the brake that acts on the upper wheel, N m, >= 0.
template <class Held, class S>
[[nodiscard]] inline S acting_brake_Nm(const Held& held, const BasicState<S>& x) noexcept {
  if constexpr (std::is_same_v<Held, HeldTorques>) {
    if (held.ripple_Nm > 0.0) [[unlikely]] {
      const double angle_rad = std::remainder(x[angle1] + held.ripple_phase_rad, 2.0 * std::numbers::pi);
      const double share = std::min(1.0, x[brake_torque] / BrakeFlaws::rippled_fully_Nm);
      return x[brake_torque] + share * held.ripple_Nm * rig::cosine(angle_rad);
    }
  }
  return x[brake_torque];
}

/// Torque of the drive motor on the lower wheel, N m; exactly 0 at duty 0.
template <class S>
[[nodiscard]] inline S motor_torque_Nm(const BasicHeldTorques<S>& held, const S& omega2_rad_s) noexcept {
  return held.motor_stall_Nm - held.motor_back_emf_Nms * omega2_rad_s;
}

/// Rate of the brake torque by (6), N m/s.
template <class S>
[[nodiscard]] inline S brake_rate_Nm_s(const BrakeAlone<S>& held, const S& torque_Nm) noexcept {
  return held.brake_rate_per_s * (held.brake_target_Nm - torque_Nm);
}
/// The same, within the limit of the rate.
template <class S>
[[nodiscard]] inline S brake_rate_Nm_s(const BasicHeldTorques<S>& held, const S& torque_Nm) noexcept {
  return rig::clamped(S(held.brake_rate_per_s * (held.brake_target_Nm - torque_Nm)), S(-held.brake_limit_Nm_s),
                      held.brake_limit_Nm_s);
}

/// The right-hand side of (1), (2) and (6) for a tyre force.
template <class S, class Held, class Upper, class Lower>
[[nodiscard, gnu::always_inline]] inline BasicState<S> rates_of(const BasicWheels<S>& wheels, const Held& held,
                                                                const S& force_N, Upper upper, Lower lower,
                                                                const BasicState<S>& x) noexcept {
  BasicState<S> rates;
  rates[omega1] = wheels.upper_rate_rad_s2(force_N, acting_brake_Nm(held, x), x[omega1], upper);
  rates[omega2] = wheels.lower_rate_rad_s2(force_N, motor_torque_Nm(held, x[omega2]), x[omega2], lower);
  rates[brake_torque] = brake_rate_Nm_s(held, x[brake_torque]);
  rates[angle1] = x[omega1];
  rates[angle2] = x[omega2];
  return rates;
}

/// The right-hand side of (1), (2) and (6) for a fixed direction of sliding and one piece of the friction profile. The
/// tyre force is odd in the slip; the factor s(r2 omega2 - r1 omega1) printed in (1) is left out, because it would
/// reverse the force in traction (docs/theory.md).
struct TorqueBalance {
  const WheelModel& model;
  const HeldTorques& held;
  PresentFactor friction;
  Sliding sliding;

  /// @param time_s  time since `friction` holds
  [[nodiscard]] double tyre_force_N(const StateVector& x, double time_s) const noexcept {
    return model.tyre_force_N(
        {x[omega1], x[omega2], acting_brake_Nm(held, x), sliding.upper, friction.after(time_s, x[angle2])});
  }

  [[nodiscard]] StateVector operator()(const StateVector& x, double time_s) const noexcept {
    const BasicWheels<double> wheels(model.wheels());
    StateVector rates = rates_of(wheels, held, tyre_force_N(x, time_s), sliding.upper, sliding.lower, x);
    if (sliding.upper == 0.0) rates[omega1] = 0.0;
    if (sliding.lower == 0.0) rates[omega2] = 0.0;
    return rates;
  }
};

/// The same while the lower wheel turns forwards, and the upper one turns forwards or is held (`Upper`), on a road
/// whose friction does not change: without a branch, for concrete models.
template <class S, class Tyre, class Load, class Torques, class Upper = Forwards>
struct RollingBalance {
  const Tyre& tyre;
  const Load& load;
  const BasicWheels<S>& wheels;
  const Torques& held;
  const S& friction;

  [[nodiscard]] UpperWheelTorques<S, Upper> upper_torques(const BasicState<S>& x) const noexcept {
    return {{}, wheels.M10_Nm + acting_brake_Nm(held, x), wheels.d1_Nms_rad * x[omega1]};
  }
  [[nodiscard, gnu::always_inline]] BasicState<S> operator()(const BasicState<S>& x,
                                                             const S& /*time_s*/) const noexcept {
    BasicState<S> rates = rates_of(wheels, held, force_N(x), Upper{}, Forwards{}, x);
    if constexpr (upper_held) rates[omega1] = S(0.0);
    return rates;
  }
  [[nodiscard, gnu::always_inline]] S force_N(const BasicState<S>& x) const noexcept {
    const S shape = tyre.shape_at(wheels.r1_m * x[omega1], wheels.r2_m * x[omega2]);
    return load.force_N(friction, shape, upper_torques(x));
  }
  /// Bound on the rate of the slip dynamics. For the magic formula it is theta B C (r1^2/J1 + r2^2/J2) / v_x.
  [[nodiscard]] S fastest_rate_per_s(const BasicState<S>& x) const noexcept {
    const S lower_per_kg = wheels.r2_m * wheels.r2_per_J2;
    const S mobility_per_kg = upper_held ? lower_per_kg : S(wheels.r1_m * wheels.r1_per_J1 + lower_per_kg);
    return load.steepest_N(friction, upper_torques(x)) * friction *
           tyre.steepest_s_m(wheels.r1_m * x[omega1], wheels.r2_m * x[omega2]) * mobility_per_kg;
  }
  /// True where friction and brake hold an upper wheel that stands.
  [[nodiscard]] auto holds_upper(const BasicState<S>& x) const noexcept
    requires std::is_same_v<Upper, Held>
  {
    return rig::magnitude(S(wheels.r1_m * force_N(x))) <= wheels.M10_Nm + acting_brake_Nm(held, x);
  }

 private:
  static constexpr bool upper_held = std::is_same_v<Upper, Held>;
};

// Integration (stepping.cpp). Set-valued Coulomb friction: at speed 0, s1 and s2 of (1) and (2) take the value in [-1,
// 1] that keeps the wheel standing, if there is one.

/// Direction in which the wheels slide from state `x`; ignores `balance.sliding`. A turning wheel slides the way it
/// turns. A standing wheel does not slide while the torque on it is within its friction, else it slides the way the
/// torque pulls it.
[[nodiscard]] Sliding sliding_from(TorqueBalance balance, const StateVector& x) noexcept;

/// Distance of `x`, `time_s` after the balance was set up, from the end of its direction of sliding or its piece of the
/// friction profile; negative beyond. It is the least of: remaining speed of a turning wheel, remaining friction of a
/// held wheel, remaining angle of the piece. It is continuous, so that its zero can be searched.
[[nodiscard]] double margin(const TorqueBalance& balance, const StateVector& x, double time_s) noexcept;

/// True if both wheels stand and the held inputs will never move them. A standing pair has no slip and hence no tyre
/// force, so the motor alone decides.
[[nodiscard]] bool stands_for_good(const WheelModel& model, const HeldTorques& held, const StateVector& x) noexcept;

/// Integrates `x` over `duration_s` > 0 under held inputs with fourth-order Runge-Kutta steps of at most `max_step_s`.
/// Steps end exactly at the end of the interval and at every instant at which a wheel stops or breaks away or a piece
/// of the friction profile ends. Does not allocate.
void integrate(const WheelModel& model, double max_step_s, const HeldTorques& held, double duration_s,
               FactorProgress& profile, StateVector& x) noexcept;

}  // namespace abs_hil::plant_sim

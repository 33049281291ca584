// Integration of the plant: steps between the instants at which a wheel stops or breaks away.
#pragma once

#include "plant_sim/torque_balance.hpp"

// Set-valued Coulomb friction: at speed 0, s1 and s2 of (1) and (2) take the value in [-1, 1] that keeps the wheel
// standing, if there is one.
namespace abs_hil::plant_sim {

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

#pragma once

#include "plant_sim/torque_balance.hpp"

// Set-valued Coulomb friction: s1 and s2 of (1) and (2) at speed 0 take whatever value in [-1, 1] keeps the wheel
// standing, if there is one.
namespace abs_hil::plant_sim {

/// How the wheels slide from state `x` on, whatever `balance.sliding` says: a turning wheel the way it turns, a
/// standing one not at all while the torque on it is within its friction, else the way it is pulled.
[[nodiscard]] Sliding sliding_from(TorqueBalance balance, const StateVector& x) noexcept;

/// How far `x`, `time_s` after the balance was struck, is from where its way of sliding or its piece of the friction
/// profile ends; negative beyond. Speed left to lose for a turning wheel, friction left before it breaks away for a
/// held one, angle left to roll for the profile; the least of them. Continuous, so that its zero can be searched.
[[nodiscard]] double margin(const TorqueBalance& balance, const StateVector& x, double time_s) noexcept;

/// True if both wheels stand and the held inputs will never move them: a standing pair has no slip, hence no tyre
/// force, so the motor alone decides.
[[nodiscard]] bool stands_for_good(const WheelModel& model, const HeldTorques& held, const StateVector& x) noexcept;

}  // namespace abs_hil::plant_sim

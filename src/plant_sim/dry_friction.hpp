#pragma once

#include "torque_balance.hpp"

// Set-valued Coulomb friction: s1 and s2 of (1) and (2) at speed 0 take whatever value in [-1, 1] keeps the wheel
// standing, if there is one.
namespace abs_hil::plant_sim {

/// How the wheels slide from state `x` on: a turning wheel the way it turns, a standing one not at all while the torque
/// on it is within its friction, else the way it is pulled.
[[nodiscard]] Sliding sliding_from(const PlantOptions& options, const HeldTorques& held, const StateVector& x) noexcept;

/// How far `x` is from where `sliding` ends; negative beyond. Speed left to lose for a turning wheel, friction left
/// before it breaks away for a held one; the lesser of both wheels. Continuous, so that its zero can be searched.
[[nodiscard]] double margin(const PlantOptions& options, const HeldTorques& held, const Sliding& sliding,
                            const StateVector& x) noexcept;

/// True if both wheels stand and the held inputs will never move them: a standing pair has no slip, hence no tyre
/// force, so the motor alone decides.
[[nodiscard]] bool stands_for_good(const PlantOptions& options, const HeldTorques& held, const StateVector& x) noexcept;

}  // namespace abs_hil::plant_sim

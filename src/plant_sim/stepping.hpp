#pragma once

#include "torque_balance.hpp"

namespace abs_hil::plant_sim {

/// Integrates `x` over `duration_s` > 0 under held inputs with fourth-order Runge-Kutta steps that end exactly at the
/// interval's end and at every instant at which a wheel stops or breaks away. Allocates nothing.
void integrate(const PlantOptions& options, const HeldTorques& held, double duration_s, StateVector& x) noexcept;

}  // namespace abs_hil::plant_sim

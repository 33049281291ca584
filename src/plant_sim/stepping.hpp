// Integration of the plant: steps between the instants at which a wheel stops or breaks away.
#pragma once

#include "plant_sim/torque_balance.hpp"

namespace abs_hil::plant_sim {

/// Integrates `x` over `duration_s` > 0 under held inputs with fourth-order Runge-Kutta steps of at most `max_step_s`.
/// Steps end exactly at the end of the interval and at every instant at which a wheel stops or breaks away or a piece
/// of the friction profile ends. Does not allocate.
void integrate(const WheelModel& model, double max_step_s, const HeldTorques& held, double duration_s,
               FactorProgress& profile, StateVector& x) noexcept;

}  // namespace abs_hil::plant_sim

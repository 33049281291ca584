#include "abs_hil/plant_sim/plant.hpp"

#include "stepping.hpp"

namespace abs_hil::plant_sim {

Plant::Plant(const PlantOptions& options) : options_(options) { check(options); }

void Plant::reset(const PlantState& state) noexcept { state_ = state; }

void Plant::advance(double duration_s, const PlantInput& input) noexcept {
  if (!(duration_s > 0.0)) return;
  const HeldTorques held = resolve(options_, input);
  StateVector x{};
  x[omega1] = state_.omega1_rad_s;
  x[omega2] = state_.omega2_rad_s;
  x[brake_torque] = options_.ideal_actuator ? held.brake_target_Nm : state_.brake_torque_Nm;
  x[angle1] = state_.angle1_rad;
  x[angle2] = state_.angle2_rad;
  integrate(options_, held, duration_s, x);
  state_ = {x[angle1], x[angle2], x[omega1], x[omega2], x[brake_torque]};
}

double Plant::slip() const noexcept { return contact_slip(options_, state_.omega1_rad_s, state_.omega2_rad_s); }

double Plant::tyre_force_N() const noexcept {
  return plant_sim::tyre_force_N(options_, state_.omega1_rad_s, state_.omega2_rad_s);
}

rig::PlantTruth Plant::truth() const noexcept {
  return {{state_.omega1_rad_s, state_.omega2_rad_s}, slip(), state_.brake_torque_Nm, options_.rig.tyre.theta_N};
}

}  // namespace abs_hil::plant_sim

#include "abs_hil/plant_sim/plant.hpp"

#include "dry_friction.hpp"
#include "stepping.hpp"

namespace abs_hil::plant_sim {
namespace {

const PlantOptions& checked(const PlantOptions& options) {
  check(options);
  return options;
}

StateVector vector_of(const PlantState& state) noexcept {
  StateVector x{};
  x[omega1] = state.omega1_rad_s;
  x[omega2] = state.omega2_rad_s;
  x[brake_torque] = state.brake_torque_Nm;
  x[angle1] = state.angle1_rad;
  x[angle2] = state.angle2_rad;
  return x;
}

}  // namespace

Plant::Plant(const PlantOptions& options)
    : options_(checked(options)),
      course_(FrictionProfile(options.friction_profile), options.rig.wheels.r2_m),
      model_(options, course_.profile().highest()) {}

void Plant::reset(const PlantState& state) noexcept {
  state_ = state;
  course_.start(state.angle2_rad);
}

void Plant::advance(double duration_s, const PlantInput& input) noexcept {
  if (!(duration_s > 0.0)) return;
  const HeldTorques held = resolve(options_, input);
  if (held.brake_target_Nm > 0.0) course_.brake_applied(state_.angle2_rad);
  StateVector x = vector_of(state_);
  if (options_.ideal_actuator) x[brake_torque] = held.brake_target_Nm;
  integrate(model_, options_.max_step_s, held, duration_s, course_, x);
  state_ = {x[angle1], x[angle2], x[omega1], x[omega2], x[brake_torque]};
}

double Plant::slip() const noexcept { return model_.slip(state_.omega1_rad_s, state_.omega2_rad_s); }

ContactState Plant::contact() const noexcept {
  const StateVector x = vector_of(state_);
  const PresentFriction friction = course_.present(state_.angle2_rad);
  const HeldTorques no_inputs{};
  const Sliding sliding = sliding_from({model_, no_inputs, friction, {}}, x);
  return {state_.omega1_rad_s, state_.omega2_rad_s, state_.brake_torque_Nm, sliding.upper, friction.value};
}

double Plant::tyre_force_N() const noexcept { return model_.tyre_force_N(contact()); }

double Plant::friction() const noexcept { return course_.present(state_.angle2_rad).value; }

rig::PlantTruth Plant::truth() const noexcept {
  return {{state_.omega1_rad_s, state_.omega2_rad_s}, slip(), state_.brake_torque_Nm, model_.peak_force_N(contact())};
}

}  // namespace abs_hil::plant_sim

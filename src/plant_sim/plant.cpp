#include "abs_hil/plant_sim/plant.hpp"

#include "plant_sim/dry_friction.hpp"
#include "plant_sim/stepping.hpp"

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

HeldTorques drifted(HeldTorques held, const DriftFactors& factors) noexcept {
  held.brake_target_Nm *= factors.brake_torque;
  held.motor_stall_Nm *= factors.motor_torque;
  held.motor_back_emf_Nms *= factors.motor_torque;
  return held;
}

}  // namespace

Plant::Plant(const PlantOptions& options)
    : options_(checked(options)),
      profile_(FactorProfile(options.friction_profile), options.rig.wheels.r2_m),
      drift_(options.drift),
      model_(options, profile_.profile().highest()) {
  let_bearings_drift(drift_.after(0.0));
}

void Plant::reset(const PlantState& state) noexcept {
  state_ = state;
  model_.part(false);
  profile_.start(state.angle2_rad);
  if (!drift_.any()) return;
  drift_.start();
  let_bearings_drift(drift_.after(0.0));
}

void Plant::let_bearings_drift(const DriftFactors& factors) noexcept {
  rig::WheelParameters wheels = options_.rig.wheels;
  wheels.M10_Nm *= factors.upper_bearing;
  wheels.d1_Nms_rad *= factors.upper_bearing;
  wheels.M20_Nm *= factors.lower_bearing;
  wheels.d2_Nms_rad *= factors.lower_bearing;
  model_.set_wheels(wheels);
}

void Plant::advance(double duration_s, const PlantInput& input) noexcept {
  if (!(duration_s > 0.0)) return;
  const HeldTorques held = resolve(options_, input);
  if (held.brake_target_Nm > 0.0) {
    profile_.brake_applied(state_.angle2_rad);
    drift_.brake_applied();
  }
  StateVector x = vector_of(state_);
  const auto go_on = [&](const HeldTorques& torques, double part_s) {
    if (options_.ideal_actuator) x[brake_torque] = torques.brake_target_Nm;
    integrate(model_, options_.max_step_s, torques, part_s, profile_, x);
  };
  if (drift_.any()) {
    // Each part uses the factors at its middle.
    for (double left_s = duration_s; left_s > 0.0;) {
      const double part_s = drift_.part_s(left_s, options_.max_step_s);
      const DriftFactors factors = drift_.after(0.5 * part_s);
      let_bearings_drift(factors);
      go_on(drifted(held, factors), part_s);
      left_s -= part_s;
      drift_.pass(part_s);
    }
    let_bearings_drift(drift_.after(0.0));
  } else {
    go_on(held, duration_s);
  }
  state_ = {x[angle1], x[angle2], x[omega1], x[omega2], x[brake_torque]};
}

double Plant::slip() const noexcept { return model_.slip(state_.omega1_rad_s, state_.omega2_rad_s); }

ContactState Plant::contact() const noexcept {
  const StateVector x = vector_of(state_);
  const PresentFactor friction = profile_.present(state_.angle2_rad);
  const HeldTorques no_inputs{};
  const Sliding sliding = sliding_from({model_, no_inputs, friction, {}}, x);
  return {state_.omega1_rad_s, state_.omega2_rad_s, state_.brake_torque_Nm, sliding.upper, friction.value};
}

double Plant::tyre_force_N() const noexcept { return model_.tyre_force_N(contact()); }

double Plant::friction() const noexcept { return profile_.present(state_.angle2_rad).value; }

rig::PlantTruth Plant::truth() const noexcept {
  return {{state_.omega1_rad_s, state_.omega2_rad_s}, slip(), state_.brake_torque_Nm, model_.peak_force_N(contact())};
}

}  // namespace abs_hil::plant_sim

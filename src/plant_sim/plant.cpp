// The plant from cycle to cycle: inputs, drift, flaws of the brake, integration.
#include "abs_hil/plant_sim/plant.hpp"

#include <algorithm>
#include <cmath>

#include "plant_sim/torque_balance.hpp"

namespace abs_hil::plant_sim {
namespace {

const PlantOptions& checked(const PlantOptions& options) {
  check(options);
  return options;
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
  brake_path_.emplace(options_.brake_flaws, options_.rig.brake, options_.ideal_actuator);
  if (!brake_path_->any()) brake_path_.reset();
  let_bearings_drift(drift_.after(0.0));
}

void Plant::reset(const PlantState& state) noexcept {
  state_ = state;
  if (brake_path_) brake_path_->start();
  model_.part(false);
  profile_.start(state.angle2_rad);
  if (!drift_.any()) return;
  drift_.start();
  let_bearings_drift(drift_.after(0.0));
}

void Plant::exchange_state(rig::StateBytes& state) {
  state(state_);
  profile_.exchange_state(state);
  drift_.exchange_state(state);
  model_.exchange_state(state);
  if (brake_path_) brake_path_->exchange_state(state);
}

PlantConditions Plant::conditions() const noexcept {
  const bool drifts = drift_.any();
  return {.friction = friction(),
          .brake_torque = drifts ? drift_.after(0.0).brake_torque : 1.0,
          .wheels = model_.wheels(),
          .steady_s = std::min(profile_.steady_s(), drift_.steady_s()),
          .steady_to_angle2_rad = profile_.steady_to_angle2_rad()};
}

void Plant::take_over(const PlantState& state, double cycle_s, std::int64_t cycles) noexcept {
  state_ = state;
  for (std::int64_t i = 0; i < cycles; ++i) {
    profile_.pass(cycle_s);
    if (drift_.any()) drift_.pass(cycle_s);
  }
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
  const HeldTorques held = resolve(options_, input, state_.omega2_rad_s);
  if (held.brake_target_Nm > 0.0) {
    profile_.brake_applied(state_.angle2_rad);
    drift_.brake_applied();
  }
  if (brake_path_) brake_path_->command(input.brake_duty);
  StateVector x = vector_of(state_);
  const auto go_on = [&](const HeldTorques& torques, double part_s) {
    if (options_.ideal_actuator) x[brake_torque] = torques.brake_target_Nm;
    integrate(model_, options_.max_step_s, torques, part_s, profile_, x);
  };
  if (drift_.any() || brake_path_ || switches_resistors()) {
    advance_in_parts(held, duration_s, input, x, go_on);
  } else {
    go_on(held, duration_s);
  }
  state_ = state_of(x);
}

/// Each part uses the drifting factors at its middle, and the start resistors at its start.
template <class Torques, class State, class GoOn>
void Plant::advance_in_parts(const Torques& held, double duration_s, const PlantInput& input, const State& x,
                             const GoOn& go_on) noexcept {
  const auto brake_power_W = [&x] { return x[brake_torque] * std::abs(x[omega1]); };
  for (double left_s = duration_s; left_s > 0.0;) {
    double part_s = drift_.any() ? drift_.part_s(left_s, options_.max_step_s) : left_s;
    HeldTorques now = held;
    if (switches_resistors() && input.motor_duty > 0.0) {
      part_s = std::min(part_s, options_.max_step_s);
      set_motor(now, options_.rig.motor, input.motor_duty, x[omega2]);
    }
    if (brake_path_) {
      part_s = brake_path_->part_s(part_s, options_.max_step_s);
      now.brake_target_Nm = brake_path_->static_Nm(part_s);
    }
    if (drift_.any()) {
      const DriftFactors factors = drift_.after(0.5 * part_s);
      let_bearings_drift(factors);
      now = drifted(now, factors);
    }
    const double power_W = brake_power_W();
    if (brake_path_) {
      now.brake_target_Nm = brake_path_->transmitted_Nm(now.brake_target_Nm, part_s, power_W);
      now.brake_rate_per_s *= brake_path_->lag_factor(now.brake_target_Nm, x[brake_torque]);
    }
    go_on(now, part_s);
    left_s -= part_s;
    if (brake_path_) brake_path_->pass(part_s, 0.5 * part_s * (power_W + brake_power_W()));
    if (drift_.any()) drift_.pass(part_s);
  }
  if (drift_.any()) let_bearings_drift(drift_.after(0.0));
}

double Plant::slip() const noexcept { return model_.slip(state_.omega1_rad_s, state_.omega2_rad_s); }

ContactState Plant::contact() const noexcept {
  const StateVector x = vector_of(state_);
  const PresentFactor friction = profile_.present(state_.angle2_rad);
  const HeldTorques no_inputs = resolve(options_, {});
  const Sliding sliding = sliding_from({model_, no_inputs, friction, {}}, x);
  return {state_.omega1_rad_s, state_.omega2_rad_s, acting_brake_Nm(no_inputs, x), sliding.upper, friction.value};
}

double Plant::tyre_force_N() const noexcept { return model_.tyre_force_N(contact()); }

double Plant::friction() const noexcept { return profile_.present(state_.angle2_rad).value; }

rig::PlantTruth Plant::truth() const noexcept {
  const ContactState now = contact();
  return {{now.omega1_rad_s, now.omega2_rad_s}, slip(), now.brake_torque_Nm, model_.peak_force_N(now)};
}

}  // namespace abs_hil::plant_sim

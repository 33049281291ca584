// What FMUs compute: the simulated rig with its variables and its step, and a slip controller.
#include "interchange/fmu/models.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "driver/board_options.hpp"

namespace abs_hil::interchange::fmu {
namespace {

/// Longest braking that a plan allows, s.
constexpr double longest_s = 600.0;

}  // namespace

PlantModel::PlantModel() {
  add(Causality::parameter, options, "plant.");
  add(Causality::parameter, experiment, "experiment.",
      [](std::string_view name) { return name == "experiment.start_speed_rad_s"; });
  add(Causality::parameter, board, "driver.sim.");
  add(Causality::parameter, begin, "run.");
  add(Causality::input, inputs_);
  add(Causality::output, outputs_);
}

void PlantModel::start(double time_s) {
  driver_ = std::make_unique<driver::SimDriver>(options,
                                                driver::SimStart{.seed = static_cast<std::uint64_t>(begin.seed),
                                                                 .start_speed_rad_s = experiment.start_speed_rad_s,
                                                                 .pwm_mode = driver::pwm_mode_named(board.pwm_mode)});
  start_s_ = time_s_ = time_s;
  driver_->configure();
  driver_->activate(0);
  driver_->scale_friction(inputs_.road_friction);
  read();
}

void PlantModel::read() {
  rig::Measurement measurement;
  static_cast<void>(
      driver_->read(std::llround((time_s_ - start_s_) * static_cast<double>(rig::ns_per_s)), measurement));
  const rig::PlantTruth truth = driver_->truth();
  const double r2_m = options.rig.wheels.r2_m;
  outputs_ = {.upper_counts = measurement.upper_counts,
              .lower_counts = measurement.lower_counts,
              .omega1_rad_s = truth.speeds.omega1_rad_s,
              .omega2_rad_s = truth.speeds.omega2_rad_s,
              .slip = truth.slip,
              .brake_torque_Nm = truth.brake_torque_Nm,
              .theta_N = truth.theta_N,
              .car_speed_m_s = r2_m * truth.speeds.omega2_rad_s,
              .distance_m = r2_m * driver_->plant().state().angle2_rad};
}

void PlantModel::step(double duration_s) {
  driver_->scale_friction(inputs_.road_friction);
  rig::Command sent;
  const driver::IoResult written = driver_->write({.motor_duty = inputs_.motor_duty,
                                                   .brake_duty = inputs_.brake_duty,
                                                   .motor_enable = inputs_.motor_enable,
                                                   .brake_torque_Nm = inputs_.brake_torque_ref_Nm},
                                                  sent);
  if (!written.ok()) throw std::invalid_argument("motor_duty or brake_duty: give numbers in [0, 1]");
  time_s_ += duration_s;
  read();
}

void PlantModel::exchange_state(rig::StateBytes& state) {
  driver_->exchange_state(state);
  state(start_s_, time_s_, outputs_);
}

ControllerModel::ControllerModel() {
  add(Causality::parameter, control, "control.",
      [](std::string_view name) { return name != "control.foreign.mapping"; });
  add(Causality::parameter, model, "model.");
  add(Causality::parameter, experiment, "experiment.",
      [](std::string_view name) { return name == "experiment.start_speed_rad_s"; });
  add(Causality::parameter, board, "driver.sim.");
  add(Causality::parameter, sensors, "sensors.");
  add(Causality::input, inputs_);
  add(Causality::output, outputs_);
}

void ControllerModel::start(double time_s) {
  std::vector<experiment::PhasePlan> plans{{.phase = rig::Phase::brake,
                                            .brake = experiment::BrakeAction::slip_control,
                                            .ends_on = {{experiment::EndKind::duration, longest_s, {}, {}}},
                                            .time_limit_s = longest_s}};
  experiment::RunLogicParts parts =
      experiment::make_logic_parts(control, model, model, sensors.ideal_actuator, {}, experiment, std::move(plans));
  grid_ = {.duty_steps = driver::full_width(driver::pwm_mode_named(board.pwm_mode)),
           .any_brake_duty = sensors.ideal_actuator};
  parts.duty_steps = grid_.any_brake_duty ? 0 : grid_.duty_steps;
  logic_ = std::make_unique<experiment::RunLogic>(std::move(parts));
  latch_ = {};
  slip_ref_tuned_ = gains_tuned_ = false;
  start_s_ = time_s_ = time_s;
  outputs_ = {.omega1_est_rad_s = experiment.start_speed_rad_s, .omega2_est_rad_s = experiment.start_speed_rad_s};
}

bool ControllerModel::tunable(const Variable& parameter) const {
  return parameter.causality == Causality::parameter && std::holds_alternative<double*>(parameter.value) &&
         control::changes_in_a_run(parameter.name, parameter.facts, control.controller);
}

void ControllerModel::tuned(const Variable& parameter) {
  (parameter.name == control::slip_ref_key ? slip_ref_tuned_ : gains_tuned_) = true;
}

/// What was tuned since the last step, as `abs_hil send slip_ref` and `send gain` do it: without a bump, the slip
/// reference one step after the gains.
void ControllerModel::tune() {
  if (time_s_ == start_s_) {
    start(start_s_);
  } else if (gains_tuned_) {
    auto law = control::make_controller(control.controller, {control, model});
    if (!law->take_over(logic_->controller())) {
      throw std::invalid_argument("the gains of controller " + control.controller +
                                  " cannot be changed while it runs; change " + std::string(control::slip_ref_key) +
                                  " only");
    }
    static_cast<void>(
        logic_->adjustments().put({.kind = experiment::Adjustment::Kind::controller, .controller = std::move(law)}));
    gains_tuned_ = false;
  } else {
    static_cast<void>(
        logic_->adjustments().put({.kind = experiment::Adjustment::Kind::slip_ref, .slip_ref = control.slip_ref}));
    slip_ref_tuned_ = false;
  }
}

void ControllerModel::step(double duration_s) {
  // Tools choose long steps by themselves (FMPy takes 1000 for a simulation at most). A step is then the control
  // period.
  const double period_s = 1.0 / control.rate_Hz;
  constexpr double slack = 1e-6;
  constexpr double longest_period_s = 0.02;
  if (duration_s < period_s * (1.0 - slack) || duration_s > std::max(longest_period_s, period_s) * (1.0 + slack)) {
    throw std::invalid_argument("a step of " + std::to_string(duration_s) + " s: give the controller steps of " +
                                std::to_string(period_s) + " s (its control.rate_Hz), at most of " +
                                std::to_string(std::max(longest_period_s, period_s)) + " s");
  }
  if (gains_tuned_ || slip_ref_tuned_) tune();
  const std::int64_t now_ns = std::llround((time_s_ - start_s_) * static_cast<double>(rig::ns_per_s));
  rig::CycleRecord record{.stamp_ns = now_ns};
  rig::Measurement measurement{
      .time_ns = now_ns, .upper_counts = inputs_.upper_counts, .lower_counts = inputs_.lower_counts};
  if (sensors.speeds_given) measurement.ideal_speeds = rig::WheelSpeeds{inputs_.omega1_rad_s, inputs_.omega2_rad_s};
  const rig::Command wanted = logic_->step(measurement, latch_, record);
  if (logic_->finished() || latch_.fault() != rig::Reason::none) {
    throw std::invalid_argument("the controller gave an output that is not a finite number, or " +
                                std::to_string(longest_s) + " s of braking are over");
  }
  const rig::Command sent = grid_.as_sent(wanted);
  logic_->commanded(sent);
  time_s_ += duration_s;
  outputs_ = ControllerOutputs::of(sent, record.control);
}

void ControllerModel::exchange_state(rig::StateBytes& state) {
  logic_->exchange_state(state);
  state(latch_, start_s_, time_s_, slip_ref_tuned_, gains_tuned_, outputs_);
}

}  // namespace abs_hil::interchange::fmu

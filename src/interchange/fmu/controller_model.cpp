// A slip controller as a model for export as an FMU.
#include "interchange/fmu/controller_model.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "driver/pwm.hpp"

namespace abs_hil::interchange::fmu {

namespace {

/// Longest braking that a plan allows, s.
constexpr double longest_s = 600.0;

rig::OptionFacts speed_facts(std::string_view meaning) {
  return {.unit = "rad/s", .meaning = meaning, .range = rig::between(-2000, 2000)};
}

}  // namespace

ControllerModel::ControllerModel() {
  add_parameters(control, "control.", [](std::string_view name) { return name != "control.foreign.mapping"; });
  add_parameters(model, "model.");
  add_parameters(experiment, "experiment.",
                 [](std::string_view name) { return name == "experiment.start_speed_rad_s"; });
  add_parameters(board, "driver.sim.");
  add_parameters(sensors, "sensors.");
  constexpr rig::Range any{.least = std::numeric_limits<std::int32_t>::min(),
                           .most = std::numeric_limits<std::int32_t>::max()};
  add(Causality::input, "upper_counts", {.meaning = "encoder counter of the upper, braked wheel", .range = any},
      &upper_counts_);
  add(Causality::input, "lower_counts", {.meaning = "encoder counter of the lower wheel, the road", .range = any},
      &lower_counts_);
  add(Causality::input, "omega1_rad_s", speed_facts("speed of the upper wheel, if sensors.speeds_given"),
      &omega1_rad_s_);
  add(Causality::input, "omega2_rad_s", speed_facts("speed of the lower wheel, if sensors.speeds_given"),
      &omega2_rad_s_);
  add(Causality::output, "brake_torque_ref_Nm", {.unit = "N m", .meaning = "brake torque asked for, after limiting"},
      &brake_torque_ref_Nm_);
  add(Causality::output, "brake_duty", {.meaning = "brake PWM, on the board's steps"}, &brake_duty_);
  add(Causality::output, "omega1_est_rad_s", {.unit = "rad/s", .meaning = "estimated speed of the upper wheel"},
      &omega1_est_rad_s_);
  add(Causality::output, "omega2_est_rad_s", {.unit = "rad/s", .meaning = "estimated speed of the lower wheel"},
      &omega2_est_rad_s_);
  add(Causality::output, "slip_est", {.meaning = "slip from the estimated speeds"}, &slip_est_);
  add(Causality::output, "theta_est_N", {.unit = "N", .meaning = "estimated peak tyre force; 0 if the law has none"},
      &theta_est_N_);
  add(Causality::output, "brake_torque_est_Nm", {.unit = "N m", .meaning = "brake torque estimated to act"},
      &estimated_torque_Nm_);
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
  brake_torque_ref_Nm_ = brake_duty_ = estimated_torque_Nm_ = slip_est_ = theta_est_N_ = 0.0;
  omega1_est_rad_s_ = omega2_est_rad_s_ = experiment.start_speed_rad_s;
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
  rig::Measurement measurement{.time_ns = now_ns, .upper_counts = upper_counts_, .lower_counts = lower_counts_};
  if (sensors.speeds_given) measurement.ideal_speeds = rig::WheelSpeeds{omega1_rad_s_, omega2_rad_s_};
  const rig::Command wanted = logic_->step(measurement, latch_, record);
  if (logic_->finished() || latch_.fault() != rig::Reason::none) {
    throw std::invalid_argument("the controller gave an output that is not a finite number, or " +
                                std::to_string(longest_s) + " s of braking are over");
  }
  const rig::Command sent = grid_.as_sent(wanted);
  logic_->commanded(sent);
  time_s_ += duration_s;
  brake_torque_ref_Nm_ = sent.brake_torque_Nm;
  brake_duty_ = sent.brake_duty;
  omega1_est_rad_s_ = record.control.speeds_est.omega1_rad_s;
  omega2_est_rad_s_ = record.control.speeds_est.omega2_rad_s;
  slip_est_ = record.control.slip_est;
  theta_est_N_ = std::isnan(record.control.theta_est_N) ? 0.0 : record.control.theta_est_N;
  estimated_torque_Nm_ = record.control.brake_torque_est_Nm;
}

void ControllerModel::exchange_state(rig::StateBytes& state) {
  logic_->exchange_state(state);
  state(latch_, start_s_, time_s_, slip_ref_tuned_, gains_tuned_);
  state(brake_torque_ref_Nm_, brake_duty_, omega1_est_rad_s_, omega2_est_rad_s_, slip_est_, theta_est_N_,
        estimated_torque_Nm_);
}

}  // namespace abs_hil::interchange::fmu

// The simulated rig as an FMU's model: its variables and its step.
#include "interchange/fmu/plant_model.hpp"

#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::interchange::fmu {

PlantModel::PlantModel() {
  add_parameters(options, "plant.");
  add_parameters(experiment, "experiment.",
                 [](std::string_view name) { return name == "experiment.start_speed_rad_s"; });
  add_parameters(board, "driver.sim.");
  add_parameters(begin, "run.");
  add(Causality::input, "motor_duty", {.meaning = "drive PWM of the lower wheel's motor", .range = rig::between(0, 1)},
      &motor_duty_);
  add(Causality::input, "brake_duty", {.meaning = "brake PWM", .range = rig::between(0, 1)}, &brake_duty_);
  add(Causality::input, "motor_enable", {.meaning = "the drive PWM is 0 while false"}, &motor_enable_);
  add(Causality::input, "brake_torque_ref_Nm",
      {.unit = "N m",
       .meaning = "brake torque asked for; acts instead of brake_duty if plant.ideal_actuator",
       .range = rig::from_zero(1000)},
      &brake_torque_ref_Nm_);
  add(Causality::input, "road_friction",
      {.meaning = "friction of the road: a factor on the plant's tyre force and its friction_profile",
       .range = rig::between(0.001, 1)},
      &road_friction_);
  add(Causality::output, "upper_counts", {.meaning = "encoder counter of the upper, braked wheel; wraps at 32 bit"},
      &upper_counts_);
  add(Causality::output, "lower_counts", {.meaning = "encoder counter of the lower wheel, the road; wraps at 32 bit"},
      &lower_counts_);
  add(Causality::output, "omega1_rad_s", {.unit = "rad/s", .meaning = "speed of the upper wheel"}, &omega1_rad_s_);
  add(Causality::output, "omega2_rad_s", {.unit = "rad/s", .meaning = "speed of the lower wheel"}, &omega2_rad_s_);
  add(Causality::output, "slip", {.meaning = "slip: 0 rolling, 1 locked, negative driven"}, &slip_);
  add(Causality::output, "brake_torque_Nm", {.unit = "N m", .meaning = "brake torque on the upper wheel"},
      &brake_torque_Nm_);
  add(Causality::output, "theta_N", {.unit = "N", .meaning = "peak tyre force theta of (10)"}, &theta_N_);
  add(Causality::output, "car_speed_m_s", {.unit = "m/s", .meaning = "speed of the lower wheel's rim"},
      &car_speed_m_s_);
  add(Causality::output, "distance_m", {.unit = "m", .meaning = "way of the lower wheel's rim since the start"},
      &distance_m_);
}

void PlantModel::start(double time_s) {
  driver_ = std::make_unique<driver::SimDriver>(options,
                                                driver::SimStart{.seed = static_cast<std::uint64_t>(begin.seed),
                                                                 .start_speed_rad_s = experiment.start_speed_rad_s,
                                                                 .pwm_mode = driver::pwm_mode_named(board.pwm_mode)});
  start_s_ = time_s_ = time_s;
  driver_->configure();
  driver_->activate(0);
  driver_->scale_friction(road_friction_);
  read();
}

void PlantModel::read() {
  rig::Measurement measurement;
  static_cast<void>(
      driver_->read(std::llround((time_s_ - start_s_) * static_cast<double>(rig::ns_per_s)), measurement));
  const rig::PlantTruth truth = driver_->truth();
  upper_counts_ = measurement.upper_counts;
  lower_counts_ = measurement.lower_counts;
  omega1_rad_s_ = truth.speeds.omega1_rad_s;
  omega2_rad_s_ = truth.speeds.omega2_rad_s;
  slip_ = truth.slip;
  brake_torque_Nm_ = truth.brake_torque_Nm;
  theta_N_ = truth.theta_N;
  const double r2_m = options.rig.wheels.r2_m;
  car_speed_m_s_ = r2_m * omega2_rad_s_;
  distance_m_ = r2_m * driver_->plant().state().angle2_rad;
}

void PlantModel::step(double duration_s) {
  driver_->scale_friction(road_friction_);
  rig::Command sent;
  const driver::IoResult written = driver_->write({.motor_duty = motor_duty_,
                                                   .brake_duty = brake_duty_,
                                                   .motor_enable = motor_enable_,
                                                   .brake_torque_Nm = brake_torque_ref_Nm_},
                                                  sent);
  if (!written.ok()) throw std::invalid_argument("motor_duty or brake_duty: give numbers in [0, 1]");
  time_s_ += duration_s;
  read();
}

void PlantModel::exchange_state(rig::StateBytes& state) {
  driver_->exchange_state(state);
  state(start_s_, time_s_);
  state(upper_counts_, lower_counts_, omega1_rad_s_, omega2_rad_s_, slip_, brake_torque_Nm_, theta_N_, car_speed_m_s_,
        distance_m_);
}

}  // namespace abs_hil::interchange::fmu

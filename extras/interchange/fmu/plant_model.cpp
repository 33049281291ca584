// The simulated rig as an FMU's model: its variables and its step.
#include "interchange/fmu/plant_model.hpp"

#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::interchange::fmu {

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

}  // namespace abs_hil::interchange::fmu

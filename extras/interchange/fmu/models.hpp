#pragma once

#include <cmath>
#include <limits>
#include <memory>

#include "abs_hil/control/options.hpp"
#include "abs_hil/driver/backend.hpp"
#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "driver/board_options.hpp"
#include "driver/sim/sim_driver.hpp"
#include "experiment/options.hpp"
#include "experiment/run_logic.hpp"
#include "interchange/fmu/model.hpp"

namespace abs_hil::interchange::fmu {

/// Row of a parameter that only the FMU needs as a number of 32 bits.
struct PlantStart {
  ABS_HIL_OPTIONS(PlantStart);
  ABS_HIL_OPTION(std::int32_t, seed, 1, .meaning = "seed of the wheels' angles within one count at the start",
                 .range = rig::from_zero(2'147'483'647));
};

struct PlantInputs {
  ABS_HIL_OPTIONS(PlantInputs);
  ABS_HIL_OPTION(double, motor_duty, 0.0, .meaning = "drive PWM of the lower wheel's motor",
                 .range = rig::between(0, 1));
  ABS_HIL_OPTION(double, brake_duty, 0.0, .meaning = "brake PWM", .range = rig::between(0, 1));
  ABS_HIL_OPTION(bool, motor_enable, true, .meaning = "the drive PWM is 0 while false");
  ABS_HIL_OPTION(double, brake_torque_ref_Nm, 0.0, .unit = "N m",
                 .meaning = "brake torque asked for; acts instead of brake_duty if plant.ideal_actuator",
                 .range = rig::from_zero(1000));
  ABS_HIL_OPTION(double, road_friction, 1.0,
                 .meaning = "friction of the road: a factor on the plant's tyre force and its friction_profile",
                 .range = rig::between(0.001, 1));
};

struct PlantOutputs {
  ABS_HIL_OPTIONS(PlantOutputs);
  ABS_HIL_OPTION(std::int32_t, upper_counts, 0,
                 .meaning = "encoder counter of the upper, braked wheel; wraps at 32 bit");
  ABS_HIL_OPTION(std::int32_t, lower_counts, 0,
                 .meaning = "encoder counter of the lower wheel, the road; wraps at 32 bit");
  ABS_HIL_OPTION(double, omega1_rad_s, 0.0, .unit = "rad/s", .meaning = "speed of the upper wheel");
  ABS_HIL_OPTION(double, omega2_rad_s, 0.0, .unit = "rad/s", .meaning = "speed of the lower wheel");
  ABS_HIL_OPTION(double, slip, 0.0, .meaning = "slip: 0 rolling, 1 locked, negative driven");
  ABS_HIL_OPTION(double, brake_torque_Nm, 0.0, .unit = "N m", .meaning = "brake torque on the upper wheel");
  ABS_HIL_OPTION(double, theta_N, 0.0, .unit = "N", .meaning = "peak tyre force theta of (10)");
  ABS_HIL_OPTION(double, car_speed_m_s, 0.0, .unit = "m/s", .meaning = "speed of the lower wheel's rim");
  ABS_HIL_OPTION(double, distance_m, 0.0, .unit = "m", .meaning = "way of the lower wheel's rim since the start");
};

/// The simulated rig at the level of its card: duties in, counts out, and the true values beside them.
class PlantModel final : public Model {
 public:
  PlantModel();
  void start(double time_s) override;
  void step(double duration_s) override;
  void exchange_state(rig::StateBytes& state) override;

  plant_sim::PlantOptions options{};
  experiment::ExperimentOptions experiment{};
  driver::SimOptions board{};
  PlantStart begin{};

 private:
  void read();

  std::unique_ptr<driver::SimDriver> driver_{};
  double start_s_{0.0};
  double time_s_{0.0};
  PlantInputs inputs_{};
  PlantOutputs outputs_{};
};

/// Rows of parameters that a run takes from elsewhere.
struct ControllerSensors {
  ABS_HIL_OPTIONS(ControllerSensors);
  ABS_HIL_OPTION(bool, speeds_given, false,
                 .meaning = "the controller takes omega1_rad_s and omega2_rad_s instead of counts");
  ABS_HIL_OPTION(bool, ideal_actuator, false, .meaning = "the torque asked for acts at once");
};

struct ControllerInputs {
  ABS_HIL_OPTIONS(ControllerInputs);
  static constexpr rig::Range any{.least = std::numeric_limits<std::int32_t>::min(),
                                  .most = std::numeric_limits<std::int32_t>::max()};
  ABS_HIL_OPTION(std::int32_t, upper_counts, 0, .meaning = "encoder counter of the upper, braked wheel", .range = any);
  ABS_HIL_OPTION(std::int32_t, lower_counts, 0, .meaning = "encoder counter of the lower wheel, the road",
                 .range = any);
  ABS_HIL_OPTION(double, omega1_rad_s, 0.0, .unit = "rad/s",
                 .meaning = "speed of the upper wheel, if sensors.speeds_given", .range = rig::between(-2000, 2000));
  ABS_HIL_OPTION(double, omega2_rad_s, 0.0, .unit = "rad/s",
                 .meaning = "speed of the lower wheel, if sensors.speeds_given", .range = rig::between(-2000, 2000));
};

struct ControllerOutputs {
  ABS_HIL_OPTIONS(ControllerOutputs);
  ABS_HIL_OPTION(double, brake_torque_ref_Nm, 0.0, .unit = "N m", .meaning = "brake torque asked for, after limiting");
  ABS_HIL_OPTION(double, brake_duty, 0.0, .meaning = "brake PWM, on the board's steps");
  ABS_HIL_OPTION(double, omega1_est_rad_s, 0.0, .unit = "rad/s", .meaning = "estimated speed of the upper wheel");
  ABS_HIL_OPTION(double, omega2_est_rad_s, 0.0, .unit = "rad/s", .meaning = "estimated speed of the lower wheel");
  ABS_HIL_OPTION(double, slip_est, 0.0, .meaning = "slip from the estimated speeds");
  ABS_HIL_OPTION(double, theta_est_N, 0.0, .unit = "N", .meaning = "estimated peak tyre force; 0 if the law has none");
  ABS_HIL_OPTION(double, brake_torque_est_Nm, 0.0, .unit = "N m", .meaning = "brake torque estimated to act");

  [[nodiscard]] static ControllerOutputs of(const rig::Command& sent, const rig::ControlState& control) {
    return {.brake_torque_ref_Nm = sent.brake_torque_Nm,
            .brake_duty = sent.brake_duty,
            .omega1_est_rad_s = control.speeds_est.omega1_rad_s,
            .omega2_est_rad_s = control.speeds_est.omega2_rad_s,
            .slip_est = control.slip_est,
            .theta_est_N = std::isnan(control.theta_est_N) ? 0.0 : control.theta_est_N,
            .brake_torque_est_Nm = control.brake_torque_est_Nm};
  }
};

/// A slip controller with its observers and its estimate of the brake: the logic of a run's braking, without the
/// command gate. It computes at the beginning of each step, from the inputs of that time.
class ControllerModel final : public Model {
 public:
  ControllerModel();
  void start(double time_s) override;
  void step(double duration_s) override;
  [[nodiscard]] bool tunable(const Variable& parameter) const override;
  void tuned(const Variable& parameter) override;
  void exchange_state(rig::StateBytes& state) override;

  control::ControlOptions control{};
  rig::RigParameters model{};
  experiment::ExperimentOptions experiment{};
  driver::SimOptions board{};
  ControllerSensors sensors{};

 private:
  void tune();

  std::unique_ptr<experiment::RunLogic> logic_{};
  bool slip_ref_tuned_{false};  ///< since the last step
  bool gains_tuned_{false};
  runtime::RunLatch latch_{};
  driver::OutputGrid grid_{};
  double start_s_{0.0};
  double time_s_{0.0};
  ControllerInputs inputs_{};
  ControllerOutputs outputs_{};
};

}  // namespace abs_hil::interchange::fmu

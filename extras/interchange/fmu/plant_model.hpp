#pragma once

#include <memory>

#include "abs_hil/plant_sim/options.hpp"
#include "driver/board_options.hpp"
#include "driver/sim/sim_driver.hpp"
#include "experiment/options.hpp"
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

}  // namespace abs_hil::interchange::fmu

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
  double motor_duty_{0.0};
  double brake_duty_{0.0};
  double brake_torque_ref_Nm_{0.0};
  bool motor_enable_{true};
  double road_friction_{1.0};
  std::int32_t upper_counts_{0};
  std::int32_t lower_counts_{0};
  double omega1_rad_s_{0.0};
  double omega2_rad_s_{0.0};
  double slip_{0.0};
  double brake_torque_Nm_{0.0};
  double theta_N_{0.0};
  double car_speed_m_s_{0.0};
  double distance_m_{0.0};
};

}  // namespace abs_hil::interchange::fmu

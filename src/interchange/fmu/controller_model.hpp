#pragma once

#include <memory>

#include "abs_hil/control/options.hpp"
#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "driver/board_options.hpp"
#include "experiment/options.hpp"
#include "experiment/run_logic.hpp"
#include "interchange/fmu/model.hpp"

namespace abs_hil::interchange::fmu {

/// Rows of parameters that a run takes from elsewhere.
struct ControllerSensors {
  ABS_HIL_OPTIONS(ControllerSensors);
  ABS_HIL_OPTION(bool, speeds_given, false,
                 .meaning = "the controller takes omega1_rad_s and omega2_rad_s instead of counts");
  ABS_HIL_OPTION(bool, ideal_actuator, false, .meaning = "the torque asked for acts at once");
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
  std::int32_t upper_counts_{0};
  std::int32_t lower_counts_{0};
  double omega1_rad_s_{0.0};
  double omega2_rad_s_{0.0};
  double brake_torque_ref_Nm_{0.0};
  double brake_duty_{0.0};
  double omega1_est_rad_s_{0.0};
  double omega2_est_rad_s_{0.0};
  double slip_est_{0.0};
  double theta_est_N_{0.0};
  double estimated_torque_Nm_{0.0};
};

}  // namespace abs_hil::interchange::fmu

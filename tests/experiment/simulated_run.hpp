#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "analysis/run_metrics.hpp"
#include "config/plan.hpp"
#include "driver/sim/sim_driver.hpp"
#include "experiment/run_session.hpp"

namespace abs_hil::experiment::test {

/// Keeps every record.
class Recorder final : public rig::RecordSink {
 public:
  void consume(const rig::CycleRecord& record, double distance_m) override {
    records.push_back(record);
    distances_m.push_back(distance_m);
  }
  std::vector<rig::CycleRecord> records;
  std::vector<double> distances_m;
};

/// Options of a simulated run. As in the configuration, the model is the plant unless it is given.
struct Setup {
  plant_sim::PlantOptions plant{};
  control::ControlOptions control{};
  ExperimentOptions experiment{};
  runtime::GateOptions gate{};
  std::uint64_t seed{1};
  driver::PwmMode pwm_mode{driver::PwmMode::bits_12};
  std::optional<rig::RigParameters> model{};
  std::vector<PhasePlan> plans{};  ///< in place of the experiment's own; empty: those

  [[nodiscard]] const rig::RigParameters& believed() const { return model ? *model : plant.rig; }
};

/// Its result.
struct Result {
  RunOutcome outcome{};
  analysis::Metrics metrics{};
  std::vector<rig::CycleRecord> records{};
  std::vector<double> distances_m{};

  /// Records of one phase, in order.
  [[nodiscard]] std::vector<rig::CycleRecord> in_phase(rig::Phase phase) const {
    std::vector<rig::CycleRecord> chosen;
    for (const auto& record : records) {
      if (record.phase == phase) chosen.push_back(record);
    }
    return chosen;
  }
};

/// The phases of the setup's experiment.
inline std::vector<PhasePlan> phases_of(const Setup& setup) {
  if (!setup.plans.empty()) return setup.plans;
  config::Settings settings;
  settings.plant = setup.plant;
  settings.control = setup.control;
  settings.experiment = setup.experiment;
  return config::plan(settings).phases;
}

inline RunLogicParts logic_parts(const Setup& setup) {
  RunLogicParts parts = make_logic_parts(setup.control, setup.believed(), plant_sim::identity_of(setup.plant),
                                         setup.plant.ideal_actuator, setup.gate, setup.experiment, phases_of(setup));
  parts.recorded_r2_m = setup.plant.rig.wheels.r2_m;
  parts.duty_steps = driver::full_width(setup.pwm_mode);
  return parts;
}

/// Runs the setup in virtual time with the program's own code, and with another controller if one is given.
inline Result run(
    const Setup& setup, const RunSession::Poll& poll = [] { return rig::Reason::none; },
    std::unique_ptr<control::SlipController> controller = nullptr) {
  runtime::VirtualClock clock;
  driver::SimDriver driver(
      setup.plant,
      {.seed = setup.seed, .start_speed_rad_s = setup.experiment.start_speed_rad_s, .pwm_mode = setup.pwm_mode});
  Recorder recorder;
  analysis::RunMetrics metrics(setup.plant.rig.wheels.r2_m, setup.experiment.end_speed_m_s);
  RunLogicParts parts = logic_parts(setup);
  if (controller) parts.controller = std::move(controller);
  RunSession session(clock, driver, std::move(parts), setup.gate, {&recorder, &metrics});
  const RunOutcome outcome = session.run_fast(poll);
  return {outcome, metrics.metrics(), std::move(recorder.records), std::move(recorder.distances_m)};
}

/// Braking from 170 rad/s without a run-up, as in the paper's initial conditions.
inline Setup braking(const std::string& controller) {
  Setup setup;
  setup.control.controller = controller;
  setup.experiment.start_speed_rad_s = 170.0;
  return setup;
}

inline Setup ideal_braking(const std::string& controller) {
  Setup setup = braking(controller);
  setup.plant.ideal_actuator = true;
  setup.plant.ideal_sensors = true;
  return setup;
}

}  // namespace abs_hil::experiment::test

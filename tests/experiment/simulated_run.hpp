#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "analysis/run_metrics.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/plan.hpp"
#include "driver/sim/sim_driver.hpp"
#include "run/run.hpp"

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

/// A plant of config/plants.
inline plant_sim::PlantOptions shipped_plant(const std::string& name) {
  config::Settings settings;
  config::KeyTable keys(settings);
  config::load_file(config::plant_file(name), keys, config::Tables::of_plant);
  return settings.plant;
}

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
  run::RunOutcome outcome{};
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
  parts.duty_steps = driver::full_width(setup.pwm_mode);
  return parts;
}

/// A run of the setup, made as the program makes it, but for what is given.
class SetupRun {
 public:
  explicit SetupRun(const Setup& setup, const run::Given& given = {})
      : settings_(settings_of(setup)),
        prepared_(settings_, config::Plan{.phases = phases_of(setup)}),
        run_(prepared_, given) {}
  run::Run* operator->() noexcept { return &run_; }

 private:
  static config::Settings settings_of(const Setup& setup) {
    config::Settings s;
    s.plant = setup.plant;
    s.model = setup.believed();
    s.control = setup.control;
    s.experiment = setup.experiment;
    s.gate = setup.gate;
    s.seed = static_cast<std::int64_t>(setup.seed);
    s.driver.sim.pwm_mode = setup.pwm_mode == driver::PwmMode::bits_8 ? "8-bit" : "12-bit";
    return s;
  }

  config::Settings settings_;
  run::Prepared prepared_;
  run::Run run_;
};

inline rig::Reason go_on() noexcept { return rig::Reason::none; }

/// Runs the setup in virtual time with the program's own code, and with another controller if one is given.
inline Result simulated(const Setup& setup, const run::Run::Poll& poll = go_on,
                        std::unique_ptr<control::SlipController> controller = nullptr) {
  run::Given given;
  if (controller) given.controller = [&controller](auto) { return std::move(controller); };
  Recorder recorder;
  SetupRun run(setup, given);
  run->record_into({&recorder});
  const run::RunOutcome outcome = run->go(poll);
  return {outcome, run->metrics().metrics(), std::move(recorder.records), std::move(recorder.distances_m)};
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

#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/control/options.hpp"
#include "abs_hil/plant_sim/options.hpp"
#include "driver/factory.hpp"
#include "experiment/options.hpp"
#include "guardian/options.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::config {

/// Everything below `telemetry.` in the configuration.
struct TelemetryOptions {
  std::string channel_prefix{"ABS_"};
  std::int32_t decimation{1};       ///< one ABS_TELEMETRY message every so many cycles, >= 1
  double status_period_s{1.0};      ///< from one ABS_STATUS to the next, run time, > 0
  double experiment_period_s{5.0};  ///< from one ABS_EXPERIMENT to the next, run time, > 0
};

/// Everything below `commands.` in the configuration.
struct CommandOptions {
  bool enabled{false};     ///< commands other than `stop` are taken over LCM
  std::string key_file{};  ///< with the secret that senders must know; its contents are no configuration value, which
                           ///< is published
};

/// One effective configuration: the defaults, then the plant's file, then the configuration file, then the command
/// line.
struct Settings {
  plant_sim::PlantOptions plant{};
  control::ControlOptions control{};
  experiment::ExperimentOptions experiment{};
  driver::DriverOptions driver{};
  runtime::GateOptions gate{};
  guardian::GuardianOptions guardian{};
  runtime::RealtimeOptions realtime{};
  TelemetryOptions telemetry{};
  CommandOptions commands{};
  std::string plant_name{"paper-table1"};
  std::string backend{"sim"};
  std::int64_t seed{1};
  std::string inject{};  ///< faults to inject, separated by commas (driver/injection); empty: none
};

}  // namespace abs_hil::config

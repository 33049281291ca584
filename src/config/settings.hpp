#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/control/options.hpp"
#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/factory.hpp"
#include "experiment/options.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/guardian_options.hpp"
#include "runtime/realtime_setup.hpp"
#include "runtime/weak_values.hpp"

namespace abs_hil::config {

/// Everything below `telemetry.` in the configuration.
struct TelemetryOptions {
  ABS_HIL_OPTIONS(TelemetryOptions);
  ABS_HIL_OPTION(std::string, channel_prefix, "ABS_", .meaning = "prefix of the LCM channels");
  ABS_HIL_OPTION(std::int32_t, decimation, 1, .meaning = "cycles for each telemetry message",
                 .range = rig::between(1, 10'000));
  ABS_HIL_OPTION(double, status_period_s, 1.0, .unit = "s", .meaning = "from one status message to the next",
                 .range = rig::between(0.01, 3600));
  ABS_HIL_OPTION(double, experiment_period_s, 5.0, .unit = "s",
                 .meaning = "from one message with the configuration to the next", .range = rig::between(0.01, 3600));
};

/// Everything below `commands.` in the configuration.
struct CommandOptions {
  ABS_HIL_OPTIONS(CommandOptions);
  ABS_HIL_OPTION(bool, enabled, false, .meaning = "take commands other than stop over LCM (docs/telemetry.md)");
  /// Only the file's name is a configuration value, because the configuration is published.
  ABS_HIL_OPTION(std::string, key_file, "", .meaning = "file with the secret that senders of commands must know");
};

/// One effective configuration. Later sources override earlier ones: the defaults, the plant's file, the model's file,
/// the configuration file, the command line.
struct Settings {
  ABS_HIL_OPTIONS(Settings);
  /// The simulated rig, the truth of a run in simulation. On a board, where the truth is unknown, `plant.rig` is the
  /// model (KeyTable::leave_out_plant).
  ABS_HIL_GROUP(plant_sim::PlantOptions, plant, "plant.", {});
  /// The rig as controllers, observers, actuator estimate and feed-forward know it. KeyTable gives each value that
  /// nobody sets the plant's value.
  ABS_HIL_GROUP(rig::RigParameters, model, "model.", {});
  /// What the rig behind a board is. In simulation that is the plant.
  ABS_HIL_GROUP(experiment::RigIdentity, rig, "rig.", {});
  ABS_HIL_GROUP(control::ControlOptions, control, "control.", {});
  ABS_HIL_GROUP(experiment::ExperimentOptions, experiment, "experiment.", {});
  ABS_HIL_GROUP(driver::DriverOptions, driver, "driver.", {});
  ABS_HIL_GROUP(runtime::GuardianOptions, guardian, "guardian.", {});
  ABS_HIL_GROUP(CommandOptions, commands, "commands.", {});
  ABS_HIL_GROUP(runtime::GateOptions, gate, "gate.", {});
  ABS_HIL_GROUP(runtime::RealtimeOptions, realtime, "realtime.", {});
  ABS_HIL_GROUP(TelemetryOptions, telemetry, "telemetry.", {});
  ABS_HIL_GROUP(runtime::UnsafeOptions, unsafe, "unsafe.", {});
  ABS_HIL_OPTION(std::string, inject, "", .key = "run.inject",
                 .meaning = "faults to inject, separated by commas (docs/fault-injection.md); never on hardware");
  ABS_HIL_OPTION(std::int64_t, seed, 1, .key = "run.seed", .meaning = "seed of everything random in the simulator",
                 .range = rig::from_zero(9e15));
  /// A text, since the seeds that studies draw have all 64 bits.
  ABS_HIL_OPTION(std::string, sensor_seed, "", .key = "run.sensor_seed",
                 .meaning = "seed of the encoders' first positions, a whole number below 2^64; empty: run.seed");
  std::string plant_name{"paper-table1"};
  std::string model_name{};  ///< of the file that the model came from; empty: it follows the plant
  std::string backend{"sim"};

  [[nodiscard]] bool on_rig() const noexcept { return backend == "rig"; }
};

/// The seed of the encoders' first positions. Throws ConfigError for a text that is no such number.
[[nodiscard]] std::uint64_t sensor_seed(const Settings& s);

/// What the outputs of the settings' backend make of a command. Throws driver::Unavailable for an unknown board.
/// @param plant  the simulated rig; not used on a board
[[nodiscard]] inline driver::OutputGrid output_grid(const Settings& s, const plant_sim::PlantOptions& plant) {
  return s.on_rig() ? driver::output_grid(s.driver) : driver::simulated_output_grid(s.driver, plant.ideal_actuator);
}

}  // namespace abs_hil::config

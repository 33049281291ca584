#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/control/options.hpp"
#include "abs_hil/plant_sim/options.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/factory.hpp"
#include "experiment/options.hpp"
#include "runtime/gate_options.hpp"
#include "runtime/realtime_setup.hpp"

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

/// Everything below `guardian.` in the configuration.
struct GuardianOptions {
  ABS_HIL_OPTIONS(GuardianOptions);
  ABS_HIL_OPTION(bool, enabled, true,
                 .meaning = "guardian: watchdog process beside a run on a board; off only with driver.emulated",
                 .safety = rig::judged_elsewhere);
  ABS_HIL_OPTION(double, timeout_ms, 20.0, .unit = "ms",
                 .meaning = "time without a sign of life of the cycle after which the guardian acts",
                 .range = rig::between(2, 1000), .safety = rig::weaker_above(40, "outputs_on_after_death"));
  /// Without end on hardware. An emulator that is gone does not come back.
  ABS_HIL_OPTION(double, insist_s, 0.0, .unit = "s",
                 .meaning =
                     "how long the guardian tries to verify the safe state; 0: until it is, or a person releases "
                     "it; 10 s on an emulator",
                 .range = rig::from_zero(1e6), .safety = rig::weaker_unless(0));
  ABS_HIL_OPTION(std::string, resident, "auto",
                 .meaning =
                     "who guards a run on a board. auto: the resident service on a real board if there is one, "
                     "else a guardian of the run's own; require: the service; off: a guardian of the run's own",
                 .allowed = {"auto", "require", "off"}, .safety = rig::weaker_if("off"));
  ABS_HIL_OPTION(std::string, socket, "/run/abs_hil/guardian.sock",
                 .meaning = "socket at which the resident service grants leases",
                 .safety = rig::weaker_unless("/run/abs_hil/guardian.sock"));
  ABS_HIL_OPTION(double, keep_ms, 5.0, .unit = "ms",
                 .meaning = "while no run is covered: time from one look at the outputs to the next",
                 .range = rig::between(1, 20), .safety = rig::weaker_above(10));
  /// The guard looks every 5 ms at most. A computer without real-time scheduling needs more.
  ABS_HIL_OPTION(double, standby_ms, 50.0, .unit = "ms",
                 .meaning = "resident service: time without a sign of life of the guard after which its standby acts",
                 .range = rig::between(20, 1000), .safety = rig::weaker_above(100));
};

/// Everything below `unsafe.` in the configuration: each key names a risk that a person accepts on hardware.
struct UnsafeOptions {
  ABS_HIL_OPTIONS(UnsafeOptions);
  ABS_HIL_OPTION(bool, outputs_on_after_death, false,
                 .meaning =
                     "accept motor and brake on for longer than 50 ms after the program's death: allows "
                     "guardian.timeout_ms above 40, driver.can.watchdog_ms above 50",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(bool, blind_control, false,
                 .meaning =
                     "accept outputs on without fresh samples for longer than 50 ms: allows "
                     "gate.sample_age_max_s above 0.05",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(bool, foreign_controller, false,
                 .meaning =
                     "accept that code from a file, which no test of this project has seen, runs in the control cycle: "
                     "allows --controller FILE on a board",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(bool, foreign_files, false,
                 .meaning =
                     "accept that a controller from a file could change the files of this user: allows --controller "
                     "FILE where the kernel has no Landlock",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
  ABS_HIL_OPTION(std::string, keys, "",
                 .meaning =
                     "accept the values of these keys, separated by commas, although they weaken the protection of a "
                     "board: docs/rig-setup.md",
                 .safety = {.kind = rig::SafetyClass::Kind::consent});
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
  ABS_HIL_GROUP(GuardianOptions, guardian, "guardian.", {});
  ABS_HIL_GROUP(CommandOptions, commands, "commands.", {});
  ABS_HIL_GROUP(runtime::GateOptions, gate, "gate.", {});
  ABS_HIL_GROUP(runtime::RealtimeOptions, realtime, "realtime.", {});
  ABS_HIL_GROUP(TelemetryOptions, telemetry, "telemetry.", {});
  ABS_HIL_GROUP(UnsafeOptions, unsafe, "unsafe.", {});
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

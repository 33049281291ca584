#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/adjustment_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "config/settings.hpp"
#include "rig/run_names.hpp"
#include "telemetry/event_log.hpp"

namespace abs_hil::replay {

/// A recorded run: every cycle from the first.
struct RecordedRun {
  experiment_t experiment{};          ///< first such message of the recording: names and effective configuration
  std::vector<telemetry_t> cycles{};  ///< index: cycle number; not empty
  std::vector<event_t> events{};
  std::vector<adjustment_t> adjustments{};  ///< ordered by cycle
  std::string cut{};                        ///< what the recording lacks, in words: that of a killed run, an older one
  bool virtual_time{false};                 ///< a run with --fast: exact wake-ups, computations take no time
};

/// Reads a run of an event log, FILE or FILE#N. Throws telemetry::RecordingError if the log is damaged, holds no run,
/// or several of which none is named, or if the run lacks a cycle.
[[nodiscard]] RecordedRun read_run(const std::string& recording);

/// Changes that a replay makes to the recorded configuration.
struct Changes {
  std::optional<std::string> controller{};
  std::vector<std::string> assignments{};  ///< key=value
};

/// The recorded configuration with changes. Throws config::ConfigError for invalid values and telemetry::RecordingError
/// for a recorded configuration that is invalid.
[[nodiscard]] config::Settings settings_of(const RecordedRun& run, const Changes& changes = {});

/// A recomputed cycle.
struct RerunCycle {
  rig::CycleRecord record{};
  double distance_m{0.0};
};

/// Source of the gate's wheel faults (reasons 130 to 142) in a rerun.
enum class WheelFaults : std::uint8_t {
  found_again,  ///< The run's own gate finds them from the recorded counts and the rerun's commands. These must equal
                ///< the commands that acted, so this requires the recorded configuration.
  as_recorded   ///< They end the rerun in the recorded cycle.
};

/// Feeds the recorded measurements at their recorded times through estimators, sequence, controller and gate of
/// `settings`. The result is what they would have commanded if their commands had not changed the rig's motion. The
/// brake model gets the recorded commands, which are those that acted. The rerun ends where the recording or the new
/// sequence ends. Events from outside the cycle (signals, stop, I/O errors, late cycles) end it in the recorded cycle.
[[nodiscard]] std::vector<RerunCycle> rerun_open_loop(const RecordedRun& run, const config::Settings& settings,
                                                      WheelFaults faults);

/// The names behind the numbers of a rerun's records.
[[nodiscard]] rig::RunNames names_of(const RecordedRun& run, const config::Settings& settings);

/// Runs the same cycle at the recorded times with the simulated rig of `settings` and the recorded seed. The gate finds
/// wheel faults again.
[[nodiscard]] std::vector<RerunCycle> rerun_simulation(const RecordedRun& run, const config::Settings& settings);

/// True if in cycle `n` the run ended, or began to end, for a reason that a rerun cannot find and takes from the
/// recording.
[[nodiscard]] bool ended_from_outside(const RecordedRun& run, std::size_t n, WheelFaults faults) noexcept;

/// Result of `abs_hil replay --check`.
struct CheckResult {
  bool equal{true};
  std::vector<std::string> lines{};  ///< each comparison and its result, as text
};

/// Runs the recorded configuration again and compares bit by bit:
/// - open loop, always: the recorded measurements must give the same estimates, phases, reasons and commands;
/// - simulation, if the recording determines the start of the run: the recorded seed and times must also give the same
///   encoder counts and true motion; for a run with --fast every telemetry message is compared byte by byte.
[[nodiscard]] CheckResult check(const RecordedRun& run);

/// A table that compares the commands of the replayed controller with those of the recorded one.
[[nodiscard]] std::string report(const RecordedRun& run, const config::Settings& replayed,
                                 const std::vector<RerunCycle>& rerun);

}  // namespace abs_hil::replay

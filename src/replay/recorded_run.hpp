#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/adjustment_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "config/settings.hpp"
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

/// Reads an event log. Throws telemetry::RecordingError if it is damaged,
/// holds no run or several runs, or lacks a cycle.
[[nodiscard]] RecordedRun read_run(const std::filesystem::path& recording);

/// Changes that a replay makes to the recorded configuration.
struct Changes {
  std::optional<std::string> controller{};
  std::vector<std::string> assignments{};  ///< key=value
};

/// The recorded configuration with changes. Throws config::ConfigError for invalid values and telemetry::RecordingError
/// for a recorded configuration that is invalid.
[[nodiscard]] config::Settings settings_of(const RecordedRun& run, const Changes& changes = {});

}  // namespace abs_hil::replay

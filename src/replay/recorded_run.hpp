#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/adjustment_t.hpp"
#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/telemetry_t.hpp"
#include "config/settings.hpp"
#include "telemetry/recording.hpp"

namespace abs_hil::replay {

/// A run as its recording tells it: every cycle from the first on.
struct RecordedRun {
  experiment_t experiment{};                ///< the first of the recording: names and effective configuration
  std::vector<telemetry_t> cycles{};        ///< cycle n at place n; not empty
  std::vector<std::int64_t> measured_ns{};  ///< when the counters of cycle n were read
  std::vector<event_t> events{};
  std::vector<adjustment_t> adjustments{};  ///< in the order of their cycles
  bool virtual_time{false};                 ///< a run with --fast: every wake-up exact, no computation took time
};

/// Reads a recording (event log or converted CSV). Throws telemetry::RecordingError for one that is damaged or cut off,
/// holds no run of abs_hil or more than one, or not every cycle of it from the first on.
[[nodiscard]] RecordedRun read_run(const std::filesystem::path& recording);

/// What a replay changes about the recorded configuration.
struct Changes {
  std::optional<std::string> controller{};
  std::vector<std::string> assignments{};  ///< key=value
};

/// The configuration that the run was made with, changed. Throws config::ConfigError for values that do not fit and
/// telemetry::RecordingError for a recorded configuration that is none.
[[nodiscard]] config::Settings settings_of(const RecordedRun& run, const Changes& changes = {});

}  // namespace abs_hil::replay

#pragma once

#include <string>
#include <vector>

#include "config/script.hpp"
#include "config/settings.hpp"
#include "experiment/sequence.hpp"

namespace abs_hil::config {

/// A script with the values of one configuration, ready to run.
struct Plan {
  std::vector<experiment::PhasePlan> phases{};
  experiment::SequenceLimits limits{};
};

/// Looks up the values that the script takes from the configuration. Throws config::ConfigError if no phase remains or
/// a value is out of its range.
[[nodiscard]] Plan plan(const Script& script, const config::Settings& settings);

/// The plan of the experiment that the settings name. The process reads each script once. Throws
/// config::ConfigError. Thread-safe.
[[nodiscard]] Plan plan(const config::Settings& settings);

/// Puts the script's tighter limits and its events into the settings. Events of the configuration take precedence.
/// Throws config::ConfigError for events that contradict each other.
void apply(const Script& script, config::Settings& settings);

/// True if the plan brakes and then waits for a stop: its last phase of kind brake, or one after it, ends only at
/// standstill or below a car speed of at most `end_speed_m_s`.
[[nodiscard]] bool means_to_stop(const Plan& plan, double end_speed_m_s);

/// The profile's largest value, 0 at least.
[[nodiscard]] double highest(const experiment::Profile& profile);

/// Describes where the script exceeds the duties and torques of rig, gate or board under these settings; empty:
/// nowhere. A run stays within them.
[[nodiscard]] std::vector<std::string> beyond_limits(const Plan& plan, const config::Settings& settings);

/// Describes which limits of time, distance and speed every run of the plan must exceed, so that it ends as a fault;
/// empty: none.
[[nodiscard]] std::vector<std::string> certain_faults(const Plan& plan, const config::Settings& settings);

/// Describes in words how the script runs under these settings: phases, their ends, limits, events, series. Throws
/// ConfigError if the script cannot run under these settings.
[[nodiscard]] std::string explain(const Script& script, const Settings& settings);

}  // namespace abs_hil::config

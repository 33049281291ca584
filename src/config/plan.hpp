#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/script.hpp"
#include "config/settings.hpp"
#include "experiment/sequence.hpp"

namespace abs_hil::config {

/// A script made ready to run under one configuration.
struct Plan {
  std::vector<experiment::PhasePlan> phases{};
  std::vector<std::string> phase_names{};  ///< of each of `phases`
  experiment::SequenceLimits limits{};
};

/// Looks up what the script leaves to the configuration. Throws config::ConfigError where the two do not go together:
/// no phase left, a value out of range.
[[nodiscard]] Plan plan(const Script& script, const config::Settings& settings);

/// The plan of the experiment that the settings name. A script is read once in the life of the process. Throws
/// config::ConfigError. Thread-safe.
[[nodiscard]] Plan plan(const config::Settings& settings);

/// What the script asks of the plant and the gate, put into the settings: tightened limits, and its events, where the
/// configuration has no own. Throws config::ConfigError for events that do not go together.
void apply(const Script& script, config::Settings& settings);

/// The number as it is under these settings. Throws config::ConfigError if it is out of its range.
[[nodiscard]] double value_of(const Script& script, const Number& number, const config::KeyTable& keys);
/// Whether it holds under these settings.
[[nodiscard]] bool holds(const When& when, const config::KeyTable& keys);

/// Where the script goes beyond what rig, gate or board give under these settings, in words; empty: nowhere. A run
/// would be held to the limits.
[[nodiscard]] std::vector<std::string> beyond_limits(const Plan& plan, const config::Settings& settings);

}  // namespace abs_hil::config

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "abs_hil/experiment/sequence.hpp"
#include "abs_hil/script/script.hpp"
#include "abs_hil/settings/settings.hpp"

namespace abs_hil::script {

/// A script made ready to run under one configuration.
struct Plan {
  std::vector<experiment::PhasePlan> phases{};
  std::vector<std::string> phase_names{};  ///< of each of `phases`
  experiment::SequenceLimits limits{};
};

/// Looks up what the script leaves to the configuration. Throws settings::ConfigError where the two do not go together:
/// no phase left, a value out of range.
[[nodiscard]] Plan plan(const Script& script, const settings::Settings& settings);

/// The plan of the experiment that the settings name. A script is read once in the life of the process. Throws
/// settings::ConfigError. Thread-safe.
[[nodiscard]] Plan plan(const settings::Settings& settings);

/// What the script asks of the plant and the gate, put into the settings: tightened limits, and its events, where the
/// configuration has no own. Throws settings::ConfigError for events that do not go together.
void apply(const Script& script, settings::Settings& settings);

/// The number as it is under these settings. Throws settings::ConfigError if it is out of its range.
[[nodiscard]] double value_of(const Script& script, const Number& number, const settings::KeyTable& keys);
/// Whether it holds under these settings.
[[nodiscard]] bool holds(const When& when, const settings::KeyTable& keys);

/// Where the script goes beyond what rig, gate or board give under these settings, in words; empty: nowhere. A run
/// would be held to the limits.
[[nodiscard]] std::vector<std::string> beyond_limits(const Plan& plan, const settings::Settings& settings);

}  // namespace abs_hil::script

#pragma once

// The summary of a run that has ended, and whole runs in virtual time that end with it.

#include <nlohmann/json.hpp>
#include <vector>

#include "analysis/run_summary.hpp"
#include "config/script.hpp"
#include "rig/record_sink.hpp"
#include "run/run.hpp"

namespace abs_hil::run {

/// What the run itself knows. What its files lost and the texts of its configuration are the caller's to add.
/// @param foreign_controller  facts of a controller from a file; null: it is not from a file
[[nodiscard]] analysis::RunSummary summarise(const Run& run, const RunOutcome& outcome,
                                             const nlohmann::ordered_json& foreign_controller = {});

/// Throws config::ConfigError unless these settings are one run that can be made in virtual time.
void require_simulated(const config::Settings& settings, const config::Script& script);

/// A run in virtual time that left its records in the caller's sinks.
struct Simulation {
  rig::RunNames names{};
  analysis::RunSummary summary{};
};

/// Runs an experiment on the simulated rig in virtual time, in the calling thread: the records are those of
/// `abs_hil --fast` with the same settings. It writes no file and no message.
/// @param sinks  get every record, in this order
/// @param poll  called every second of virtual time; a reason other than `none` ends the run in order
/// Throws config::ConfigError and std::invalid_argument for settings that cannot be used.
[[nodiscard]] Simulation simulate(const config::Settings& settings, const config::Script& script,
                                  const std::vector<rig::RecordSink*>& sinks, const Run::Poll& poll);

}  // namespace abs_hil::run

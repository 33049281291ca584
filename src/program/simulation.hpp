#pragma once

#include <string>
#include <vector>

#include "analysis/run_summary.hpp"
#include "experiment/run_session.hpp"
#include "program/command_line.hpp"
#include "rig/record_sink.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::program {

/// A run in virtual time that left its records in the caller's sinks.
struct Simulation {
  rig::RunNames names{};
  analysis::RunSummary summary{};
};

/// Runs an experiment on the simulated rig in virtual time, in the calling thread and through the program's own cycle:
/// the records are those of `abs_hil --fast` with the same options. It writes no file and no message.
/// @param request  with backend sim; its outputs are not used
/// @param sinks  get every record, in this order
/// @param poll  called every second of virtual time; a reason other than `none` ends the run in order
/// Throws config::ConfigError and std::invalid_argument for options that cannot be used.
[[nodiscard]] Simulation simulate(RunRequest request, std::vector<rig::RecordSink*> sinks,
                                  const experiment::RunSession::Poll& poll);

}  // namespace abs_hil::program

#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>

#include "analysis/run_metrics.hpp"
#include "analysis/run_summary.hpp"
#include "experiment/run_session.hpp"
#include "program/command_line.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::program {

/// What the sinks of a run found and lost.
struct RunResults {
  analysis::Metrics metrics{};
  nlohmann::ordered_json friction_curve{};  ///< null without that analysis
  std::uint64_t publish_failures{0};
  std::uint64_t csv_rows_lost{0};
  rig::RunNames names{};
  nlohmann::ordered_json foreign_controller{};  ///< null for a controller of the registry
};

/// The summary of a run that has ended.
[[nodiscard]] analysis::RunSummary summarise(const RunRequest& request, const experiment::RunSession& session,
                                             const experiment::RunOutcome& outcome, const RunResults& results);

}  // namespace abs_hil::program

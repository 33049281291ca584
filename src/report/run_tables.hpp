#pragma once

#include <string>
#include <vector>

#include "report/run_files.hpp"
#include "report/run_survey.hpp"

/// Parts of the page as HTML; empty if there is nothing to show.
namespace abs_hil::report {

[[nodiscard]] std::string metrics_table(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys);
[[nodiscard]] std::string timing_table(const std::vector<RunFiles>& runs);
[[nodiscard]] std::string differences_table(const std::vector<RunFiles>& runs);
[[nodiscard]] std::string events_table(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys);
[[nodiscard]] std::string environment_table(const std::vector<RunFiles>& runs);
[[nodiscard]] std::string notes_list(const std::vector<std::string>& notes);

/// The general notes, then notes about missing or unusual data of each run.
[[nodiscard]] std::vector<std::string> all_notes(const std::vector<RunFiles>& runs,
                                                 const std::vector<RunSurvey>& surveys,
                                                 const std::vector<std::string>& general);

}  // namespace abs_hil::report

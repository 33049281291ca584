#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "report/figure.hpp"
#include "report/run_curves.hpp"
#include "report/run_files.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

using Profiles = std::map<std::string, Profile>;

/// The whole runs: speeds of both wheels, and below them a strip per run with its phases and events.
[[nodiscard]] Figure profile_figure(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys,
                                    const std::vector<Profiles>& profiles,
                                    const std::function<Style(std::size_t)>& style, std::vector<LegendEntry> legend);

}  // namespace abs_hil::report

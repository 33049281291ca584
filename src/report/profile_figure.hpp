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

using Courses = std::map<std::string, Profile>;

/// The runs from start to end: speeds of both wheels, below them each run's phases and events on a strip of its own.
[[nodiscard]] Figure profile_figure(const std::vector<RunFiles>& runs, const std::vector<RunSurvey>& surveys,
                                    const std::vector<Courses>& profiles,
                                    const std::function<Style(std::size_t)>& style, std::vector<LegendEntry> legend);

}  // namespace abs_hil::report

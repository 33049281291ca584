#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report/figure.hpp"
#include "report/run_files.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// Runs of a series of runs that share the values of the varied keys.
struct SeriesGroup {
  std::string label{};
  std::vector<std::size_t> runs{};
  std::optional<double> value{};  ///< of the first varied key, if it is a number
};

struct SeriesStudy {
  std::vector<std::string> keys{};    ///< varied keys, except seeds
  std::vector<SeriesGroup> groups{};  ///< in the order of their values; one group of all runs if nothing varies
};

[[nodiscard]] SeriesStudy study(const Series& series, const std::vector<RunFiles>& runs);

/// Mean, standard deviation and 95 % confidence interval of each figure of merit by group, as HTML.
[[nodiscard]] std::string series_table(const SeriesStudy& study, const std::vector<RunFiles>& runs,
                                       const std::vector<RunSurvey>& surveys);

/// Every run's figures of merit over the varied keys, with mean and interval.
[[nodiscard]] Figure series_figure(const std::string& id, const SeriesStudy& study, const std::vector<RunFiles>& runs,
                                   const std::vector<RunSurvey>& surveys);

}  // namespace abs_hil::report

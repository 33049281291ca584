#pragma once

#include <string>
#include <vector>

#include "abs_hil/report/run_files.hpp"
#include "abs_hil/report/run_survey.hpp"

namespace abs_hil::report {

/// The simulated rig becomes another one while the run goes on, as its configuration says.
struct PlantChange {
  double time_s{0.0};   ///< since the start of the run
  std::string label{};  ///< plain: "friction × 0.5", "friction drifts" where a slope begins
};

/// Changes at instants that the run reached, in the order of the parameters. Those over distance are left out, as are
/// those that count from braking in a run that does not brake, and profiles that cannot be read.
[[nodiscard]] std::vector<PlantChange> plant_changes(const RunFiles& run, const RunSurvey& survey);

}  // namespace abs_hil::report

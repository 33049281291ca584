#pragma once

#include <string>
#include <vector>

#include "replay/rerun.hpp"

namespace abs_hil::replay {

/// What the replayed controller would have asked for beside what the recorded one did, as a table for people.
[[nodiscard]] std::string report(const RecordedRun& run, const config::Settings& replayed,
                                 const std::vector<RerunCycle>& rerun);

}  // namespace abs_hil::replay

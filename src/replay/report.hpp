#pragma once

#include <string>
#include <vector>

#include "replay/rerun.hpp"

namespace abs_hil::replay {

/// A table that compares the commands of the replayed controller with those of the recorded one.
[[nodiscard]] std::string report(const RecordedRun& run, const config::Settings& replayed,
                                 const std::vector<RerunCycle>& rerun);

}  // namespace abs_hil::replay

#pragma once

#include <string>

#include "guardian/guardian_loop.hpp"
#include "guardian/launch_config.hpp"

namespace abs_hil::guardian_program {

/// Writes the flight record of a run to the files that its launch config names, if it names any. Tells on stderr.
void write_flight_files(const guardian::LaunchConfig& launch, const std::string& channel_prefix,
                        const guardian::SharedRegion& region, const guardian::GuardianReport& report,
                        std::string account);

}  // namespace abs_hil::guardian_program

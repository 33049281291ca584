#pragma once

#include <string>

#include "guardian/guardian_report.hpp"
#include "guardian/launch_config.hpp"
#include "runtime/flight_ring.hpp"

namespace abs_hil::guardian {

/// Writes the flight record of a run to the files that its launch config names, if it names any. Tells on stderr.
void write_flight_files(const LaunchConfig& launch, const std::string& channel_prefix,
                        const runtime::FlightRing& recorder, const GuardianReport& report, std::string account);

}  // namespace abs_hil::guardian

#pragma once

#include <string>

#include "guardian/mail.hpp"
#include "runtime/flight_ring.hpp"
#include "runtime/realtime_setup.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::guardian {

/// What the controller passes to the guardian when it starts it.
struct LaunchConfig {
  telemetry::ExperimentInfo run{};  ///< for the flight recorder's files; without names of phases
  runtime::RealtimeMode realtime{runtime::RealtimeMode::prefer};
  std::string record_prefix{};  ///< path prefix of the files that the guardian writes; empty: it writes none
};

[[nodiscard]] std::string to_json(const LaunchConfig& config);
/// Throws std::runtime_error if `json` is not a launch configuration.
[[nodiscard]] LaunchConfig parse_launch_config(const std::string& json);

/// Writes the flight record of a run to the files that its launch config names, if it names any. Tells on stderr.
void write_flight_files(const LaunchConfig& launch, const std::string& channel_prefix,
                        const runtime::FlightRing& recorder, const GuardianReport& report, std::string account);

}  // namespace abs_hil::guardian

#include "guardian/flight_files.hpp"

#include <cstdio>
#include <utility>

#include "telemetry/flight_record.hpp"

namespace abs_hil::guardian {

void write_flight_files(const LaunchConfig& launch, const std::string& channel_prefix,
                        const runtime::FlightRing& recorder, const GuardianReport& report, std::string account) {
  if (launch.record_prefix.empty()) return;
  const auto records = recorder.contents();
  std::vector<std::string> problems;
  const auto files = telemetry::write_flight_record(launch.record_prefix,
                                                    {.records = records,
                                                     .reason = report.reason,
                                                     .reason_value = static_cast<double>(report.silence_ns) * 1e-9,
                                                     .account = std::move(account)},
                                                    {.experiment = launch.experiment,
                                                     .controller = launch.controller,
                                                     .plant = launch.plant,
                                                     .backend = launch.backend,
                                                     .config_json = launch.config_json,
                                                     .version = launch.version,
                                                     .names = {.phases = {}, .signals = launch.signals}},
                                                    channel_prefix, problems);
  for (const auto& file : files) std::fprintf(stderr, "abs_guardian: wrote %s\n", file.c_str());
  for (const auto& problem : problems) std::fprintf(stderr, "abs_guardian: %s\n", problem.c_str());
}

}  // namespace abs_hil::guardian

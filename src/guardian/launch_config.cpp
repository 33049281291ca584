// The launch configuration as JSON, and the flight record that it asks for.
#include "guardian/launch_config.hpp"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "rig/parse_json.hpp"
#include "telemetry/flight_record.hpp"

namespace abs_hil::guardian {

std::string to_json(const LaunchConfig& config) {
  const telemetry::ExperimentInfo& run = config.run;
  return nlohmann::json{{"config_json", run.config_json},
                        {"experiment", run.experiment},
                        {"controller", run.controller},
                        {"plant", run.plant},
                        {"backend", run.backend},
                        {"version", run.version},
                        {"realtime", static_cast<int>(config.realtime)},
                        {"record_prefix", config.record_prefix},
                        {"signals", run.names.signals}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

LaunchConfig parse_launch_config(const std::string& json) try {
  const nlohmann::json object = rig::parse_json(json);
  return {.run = {.experiment = object.at("experiment"),
                  .controller = object.at("controller"),
                  .plant = object.at("plant"),
                  .backend = object.at("backend"),
                  .config_json = object.at("config_json"),
                  .version = object.at("version"),
                  .names = {.signals = object.at("signals")}},
          .realtime = static_cast<runtime::RealtimeMode>(object.at("realtime").get<int>()),
          .record_prefix = object.at("record_prefix")};
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(std::string("guardian: not a launch configuration: ") + error.what());
}

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
                                                    launch.run, channel_prefix, problems);
  for (const auto& file : files) std::fprintf(stderr, "abs_guardian: wrote %s\n", file.c_str());
  for (const auto& problem : problems) std::fprintf(stderr, "abs_guardian: %s\n", problem.c_str());
}

}  // namespace abs_hil::guardian

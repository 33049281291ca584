#pragma once

#include <string>
#include <vector>

namespace abs_hil::guardian {

/// What the controller passes to the guardian when it starts it.
struct LaunchConfig {
  std::string config_json{};  ///< the run's effective configuration
  std::string experiment{};   ///< this and the next four: for the flight recorder's log
  std::string controller{};
  std::string plant{};
  std::string backend{};
  std::string version{};
  std::vector<std::string> signals{};  ///< names of the controller's own signals, for the flight recorder's files
  std::string realtime{};              ///< "require", "prefer" or "off"
  std::string record_prefix{};         ///< path prefix of the files that the guardian writes; empty: it writes none
};

[[nodiscard]] std::string to_json(const LaunchConfig& config);
/// Throws std::runtime_error if `json` is not a launch configuration.
[[nodiscard]] LaunchConfig parse_launch_config(const std::string& json);

}  // namespace abs_hil::guardian

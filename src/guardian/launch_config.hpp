#pragma once

#include <string>

namespace abs_hil::guardian {

/// What a guardian is told when it is started.
struct LaunchConfig {
  std::string config_json{};  ///< the run's effective configuration
  std::string experiment{};   ///< names, for the flight recorder's log
  std::string controller{};
  std::string plant{};
  std::string backend{};
  std::string version{};
  std::string realtime{};       ///< "require", "prefer" or "off"
  std::string record_prefix{};  ///< path and beginning of the names of what it writes; empty: it writes no file
};

[[nodiscard]] std::string to_json(const LaunchConfig& brief);
/// Throws std::runtime_error for text that is no brief.
[[nodiscard]] LaunchConfig parse_launch_config(const std::string& json);

}  // namespace abs_hil::guardian

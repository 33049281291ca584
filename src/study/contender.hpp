// The controllers of a study, each with the settings of its own.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/settings.hpp"

namespace abs_hil::study {

/// One column of a comparison: a controller with the settings of its own.
struct Contender {
  std::string name;             ///< heading of its column: the label, or the text that describes it
  config::Settings settings{};  ///< with `control.controller` set
  std::vector<std::pair<std::string, std::string>> changes{};  ///< keys and values of its own, as text
};

/// Splits "adaptive,soft=adaptive{gamma=20,ka1=0.5},gains.toml" at the commas outside of braces. "all" stands for every
/// controller. Throws std::invalid_argument for braces that do not match, and for an empty entry.
[[nodiscard]] std::vector<std::string> split_contenders(std::string_view list);

/// Reads [LABEL=]CONTROLLER, [LABEL=]CONTROLLER{KEY=VALUE,FILE.toml,...} or [LABEL=]FILE.toml over the common settings.
/// A key is one of control.* or model.*, since all contenders meet the same plants; "control." and the controller's own
/// part may be left out. A file sets the same keys, and without a controller before it names that in
/// control.controller. Throws config::ConfigError and std::invalid_argument, naming entry, key and fix.
[[nodiscard]] Contender read_contender(const std::string& text, const config::Settings& common);

}  // namespace abs_hil::study

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// Describes in words how the script runs under these settings: phases, their ends, limits, events, series. Throws
/// config::ConfigError if the script cannot run under these settings.
[[nodiscard]] std::string explain(const Script& script, const config::Settings& settings);

/// The JSON Schema (draft 2020-12) of scripts, for editors. It is made from the parser's own grammar.
[[nodiscard]] nlohmann::ordered_json schema();

/// A plant's file to fill in for a rig of one's own: every key of `plant` with its value in `settings`, its meaning,
/// unit and range, and where to read it off the rig. It can be given to --plant and --model at once.
/// @param name  of the rig, for the first lines
[[nodiscard]] std::string rig_file(const Settings& settings, std::string_view name);

}  // namespace abs_hil::config

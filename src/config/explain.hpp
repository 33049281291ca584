#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// Describes in words how the script runs under these settings: phases, their ends, limits, events, series. Throws
/// config::ConfigError if the script cannot run under these settings.
[[nodiscard]] std::string explain(const Script& script, const config::Settings& settings);

/// The JSON Schema (draft 2020-12) of scripts, for editors. It is made from the parser's own grammar.
[[nodiscard]] nlohmann::ordered_json schema();

}  // namespace abs_hil::config

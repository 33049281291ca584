#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::config {

/// The script in words, as it runs under these settings: phases, what ends them, limits, events, series. Throws
/// config::ConfigError where the two do not go together.
[[nodiscard]] std::string explain(const Script& script, const config::Settings& settings);

/// What a script may hold as a JSON Schema (draft 2020-12) for editors, made from the parser's own grammar.
[[nodiscard]] nlohmann::ordered_json schema();

}  // namespace abs_hil::config

#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "config/key_table.hpp"

namespace abs_hil::config {

/// Sets every value of an effective configuration, as KeyTable::to_json writes it. Throws ConfigError for a value that
/// does not fit its key. Returns the unknown names, which another version wrote.
[[nodiscard]] std::vector<std::string> load_json(const nlohmann::ordered_json& config, KeyTable& table,
                                                 std::string_view origin);
/// Sets the values of some tables of an effective configuration, given as JSON text. Throws ConfigError for a value
/// that does not fit its key, for a table that is missing, and for text that is not JSON.
void load_tables(std::string_view text, std::initializer_list<const char*> tables, KeyTable& keys,
                 std::string_view origin);

/// Texts of settings and command lines are written to JSON (summary, logs), which is UTF-8.
[[nodiscard]] bool is_utf8(const std::string& text);

}  // namespace abs_hil::config

#pragma once

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

}  // namespace abs_hil::config

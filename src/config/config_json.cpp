// Reads an effective configuration back from the JSON that a run recorded.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "rig/parse_json.hpp"

namespace abs_hil::config {

namespace {

void set_values(const nlohmann::ordered_json& node, const std::string& name, KeyTable& table, std::string_view origin,
                std::vector<std::string>& unknown) {
  if (node.is_object()) {
    for (const auto& [key, value] : node.items()) {
      set_values(value, name.empty() ? key : fmt::format("{}.{}", name, key), table, origin, unknown);
    }
    return;
  }
  const auto is_named = [&name](const Key& key) { return key.name == name; };
  if (std::none_of(table.keys().begin(), table.keys().end(), is_named)) {
    unknown.push_back(name);
  } else if (node.is_boolean()) {
    table.set(name, node.get<bool>(), origin);
  } else if (node.is_number_integer()) {
    table.set(name, node.get<std::int64_t>(), origin);
  } else if (node.is_number()) {
    table.set(name, node.get<double>(), origin);
  } else if (node.is_string()) {
    table.set(name, node.get<std::string>(), origin);
  } else {
    throw ConfigError(std::string(origin) + ": " + name + " is neither a number, a flag nor a text; give one of them");
  }
}

}  // namespace

std::vector<std::string> load_json(const nlohmann::ordered_json& config, KeyTable& table, std::string_view origin) {
  if (!config.is_object())
    throw ConfigError(std::string(origin) + ": the configuration is not a JSON object; give one");
  std::vector<std::string> unknown;
  set_values(config, {}, table, origin, unknown);
  return unknown;
}

void load_tables(std::string_view text, std::initializer_list<const char*> tables, KeyTable& keys,
                 std::string_view origin) try {
  const auto config = rig::parse_json<nlohmann::ordered_json>(text);
  std::vector<std::string> unknown;
  for (const char* table : tables) set_values(config.at(table), table, keys, origin, unknown);
} catch (const nlohmann::json::exception& error) {
  throw ConfigError(std::string(origin) + ": " + error.what());
}

}  // namespace abs_hil::config

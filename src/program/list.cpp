#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/library.hpp"
#include "driver/factory.hpp"
#include "program/exit_status.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

void print(std::string_view name, std::string_view summary) { fmt::print("  {:<21} {}\n", name, summary); }

/// The controllers' own signals. They may depend on options, which are the defaults here.
void list_signals() {
  const config::Settings settings;
  fmt::print("signals (of a controller's own, beside the quantities of every run)\n");
  for (const auto& entry : control::controllers()) {
    const auto controller = control::make_controller(entry.name, {settings.control, settings.model});
    const std::vector<std::string> names = rig::signal_names(controller->signals());
    if (!names.empty()) print(entry.name, fmt::format("{}", fmt::join(names, ", ")));
  }
}

std::string valid_of(const config::Key& key) {
  if (std::holds_alternative<bool*>(key.target)) return "true or false";
  if (!std::holds_alternative<std::string*>(key.target)) return key.range.text();
  if (key.allowed.empty()) return "text";
  std::string text = fmt::format("{}", fmt::join(key.allowed.list(), " | "));
  for (const std::string_view ending : key.files.endings) {
    if (!ending.empty()) text.append(" | FILE").append(ending);
  }
  return text;
}

/// How the key bears on the safety of a run on a board.
std::string class_of(const config::Key& key) { return config::safety_of(key).in_words(key.unit); }

void list_keys(bool json) {
  config::Settings settings;
  const config::KeyTable table(settings);
  std::size_t name_width = 0, value_width = 0;
  if (json) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (const config::Key& key : table.keys()) {
      rows.push_back({{"name", key.name},
                      {"value", config::value_text(key)},
                      {"valid", valid_of(key)},
                      {"unit", key.unit},
                      {"meaning", key.meaning},
                      {"safety", class_of(key)}});
    }
    fmt::print("{}\n", rows.dump(1));
    return;
  }
  for (const config::Key& key : table.keys()) {
    name_width = std::max(name_width, key.name.size());
    value_width = std::max(value_width, config::value_text(key).size());
  }
  for (const config::Key& key : table.keys()) {
    fmt::print("{:<{}}  {:<{}}  {}{}{}; {} [{}]\n", key.name, name_width, config::value_text(key), value_width,
               valid_of(key), key.unit.empty() ? "" : " ", key.unit, key.meaning, class_of(key));
  }
}

}  // namespace

int list(bool keys, bool json) {
  if (keys) {
    list_keys(json);
    return exit_completed;
  }
  fmt::print("controllers\n");
  for (const auto& entry : control::controllers()) print(entry.name, entry.summary);
  fmt::print("plants\n");
  for (const auto& entry : config::known_plants()) print(entry.name, entry.description);
  fmt::print("experiments\n");
  for (const auto& script : config::known_experiments()) print(script->name, script->description);
  fmt::print("backends\n");
  for (const auto& entry : driver::backend_kinds()) print(entry.name, entry.summary);
  fmt::print("boards (driver.kind of backend rig; none is verified on hardware)\n");
  for (const auto& entry : driver::registered_backends()) print(entry.name, entry.summary);
  list_signals();
  return exit_completed;
}

}  // namespace abs_hil::program

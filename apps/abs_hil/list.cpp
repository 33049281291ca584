#include <fmt/format.h>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/driver/factory.hpp"
#include "abs_hil/script/library.hpp"
#include "abs_hil/settings/config_file.hpp"
#include "abs_hil/settings/key_table.hpp"
#include "commands.hpp"
#include "exit_status.hpp"

namespace abs_hil::app {

namespace {

void print(std::string_view name, std::string_view summary) { fmt::print("  {:<20}{}\n", name, summary); }

void list_keys() {
  settings::Settings settings;
  const settings::KeyTable table(settings);
  for (const settings::Key& key : table.keys()) {
    const bool is_flag = std::holds_alternative<bool*>(key.target);
    const bool is_text = std::holds_alternative<std::string*>(key.target);
    const std::string valid = is_flag ? "true or false"
                              : is_text
                                  ? (key.allowed.empty() ? "text" : fmt::format("{}", fmt::join(key.allowed, " | ")))
                                  : key.range.text();
    const std::string value = std::visit([](const auto* v) { return fmt::format("{}", *v); }, key.target);
    fmt::print("{:<38}{:<16}{}{}{}; {}\n", key.name, value, valid, key.unit.empty() ? "" : " ", key.unit, key.meaning);
  }
}

}  // namespace

int list(bool keys) {
  if (keys) {
    list_keys();
    return exit_completed;
  }
  fmt::print("controllers\n");
  for (const auto& entry : control::controllers()) print(entry.name, entry.summary);
  fmt::print("plants\n");
  for (const auto& entry : settings::known_plants()) print(entry.name, entry.description);
  fmt::print("experiments\n");
  for (const auto& script : script::known_experiments()) print(script->name, script->description);
  fmt::print("backends\n");
  for (const auto& entry : driver::backends()) print(entry.name, entry.summary);
  fmt::print("boards (driver.kind of backend rig; none of them verified on hardware)\n");
  for (const auto& entry : driver::boards()) print(entry.name, entry.summary);
  return exit_completed;
}

}  // namespace abs_hil::app

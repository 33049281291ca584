// `abs_hil list`: names of what there is, and the tables of keys, quantities and reasons.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/reason.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/script.hpp"
#include "driver/factory.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

using Json = nlohmann::ordered_json;  // keeps the order of insertion

std::string_view name_of(rig::Topic topic) {
  switch (topic) {
    case rig::Topic::sequence: return "sequence";
    case rig::Topic::motion: return "motion";
    case rig::Topic::board: return "board";
    case rig::Topic::timing: return "timing";
  }
  return "";
}

template <class Value>
std::string_view type_name() {
  if constexpr (std::is_same_v<Value, bool>) return "boolean";
  if constexpr (std::is_same_v<Value, rig::Phase>) return "name";
  return std::is_floating_point_v<Value> ? "number" : "integer";
}

/// One object per row of the table. `csv_column` counts from 1; null if the CSV lacks the quantity.
Json quantities() {
  Json rows = Json::array();
  int column = 0;
  rig::for_each_quantity([&](const auto& row) {
    using Value = rig::ValueOf<std::decay_t<decltype(row)>>;
    Json entry{{"name", row.name},
               {"unit", row.unit},
               {"type", type_name<Value>()},
               {"topic", name_of(row.topic)},
               {"csv_column", row.in_csv() ? Json(++column) : Json()},
               {"since", row.since},
               {"meaning", row.meaning}};
    if constexpr (std::is_same_v<Value, rig::Phase>) {
      for (int phase = 0; phase <= static_cast<int>(rig::Phase::fault); ++phase) {
        entry["values"].push_back(rig::name_of(static_cast<rig::Phase>(phase)));
      }
    }
    rows.push_back(std::move(entry));
  });
  return rows;
}

Json reasons() {
  Json rows = Json::array();
  for (const rig::ReasonRow& row : rig::reasons) {
    rows.push_back({{"number", static_cast<std::uint16_t>(row.reason)},
                    {"name", row.name},
                    {"kind", rig::name_of(row.kind)},
                    {"found_again", rig::name_of(row.found_again)},
                    {"text", row.text},
                    {"quantity", row.value.quantity},
                    {"unit", row.value.unit},
                    {"bound", row.value.bound}});
  }
  return rows;
}

void print(std::string_view name, std::string_view summary) { cli::print("  {:<21} {}\n", name, summary); }

/// The controllers' own signals. They may depend on options, which are the defaults here.
void list_signals() {
  const config::Settings settings;
  cli::print("signals (of a controller's own, beside the quantities of every run)\n");
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
    if (!ending.empty()) text.append(ending.starts_with('.') ? " | FILE" : " | ").append(ending);
  }
  return text;
}

/// Each key of the configuration with its default.
Json keys() {
  config::Settings settings;
  const config::KeyTable table(settings);
  Json rows = Json::array();
  for (const config::Key& key : table.keys()) {
    rows.push_back({{"name", key.name},
                    {"value", config::text_of(config::value_of(key))},
                    {"valid", valid_of(key)},
                    {"unit", key.unit},
                    {"meaning", key.meaning},
                    {"safety", config::safety_of(key).in_words(key.unit)}});
  }
  return rows;
}

std::string text_in(const Json& row, const char* column) { return row[column].get<std::string>(); }

void list_keys() {
  const Json rows = keys();
  std::size_t name_width = 0, value_width = 0;
  for (const Json& row : rows) {
    name_width = std::max(name_width, text_in(row, "name").size());
    value_width = std::max(value_width, text_in(row, "value").size());
  }
  for (const Json& row : rows) {
    const std::string unit = text_in(row, "unit");
    const std::string safety = text_in(row, "safety");
    cli::print("{:<{}}  {:<{}}  {}{}{}; {}{}\n", text_in(row, "name"), name_width, text_in(row, "value"), value_width,
               text_in(row, "valid"), unit.empty() ? "" : " ", unit, text_in(row, "meaning"),
               safety != rig::no_effect_on_safety.in_words("") ? fmt::format(" [{}]", safety) : "");
  }
}

void list_quantities() {
  cli::print("{:<24}  {:<15}  {:>3}  {}\n", "quantity", "unit", "CSV", "meaning");
  for (const Json& row : quantities()) {
    cli::print("{:<24}  {:<15}  {:>3}  {}\n", text_in(row, "name"), text_in(row, "unit"),
               row["csv_column"].is_null() ? "" : row["csv_column"].dump(), text_in(row, "meaning"));
  }
}

void list_reasons() {
  cli::print("{:>6}  {:<12}  {:<32}  {}\n", "number", "kind", "found again by replay", "reason");
  for (const rig::ReasonRow& row : rig::reasons) {
    cli::print("{:>6}  {:<12}  {:<32}  {}\n", static_cast<std::uint16_t>(row.reason), rig::name_of(row.kind),
               rig::name_of(row.found_again), row.text);
  }
}

void list_names() {
  cli::print("controllers\n");
  for (const auto& entry : control::controllers()) print(entry.name, entry.summary);
  cli::print("plants\n");
  for (const auto& entry : config::known_plants()) print(entry.name, entry.description);
  cli::print("experiments\n");
  for (const auto& script : config::known_experiments()) print(script->name, script->description);
  cli::print("backends\n");
  for (const auto& entry : driver::backend_kinds()) print(entry.name, entry.summary);
  cli::print("boards (driver.kind of backend rig; none is verified on hardware)\n");
  for (const auto& entry : driver::registered_backends()) print(entry.name, entry.summary);
  list_signals();
}

struct ListOptions {
  bool keys{false};
  bool quantities{false};
  bool reasons{false};
  bool json{false};
};

}  // namespace

Action add_list(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<ListOptions>();
  parser.add("--keys", &o->keys, "list all configuration values with unit, range and safety class");
  parser.add("--quantities", &o->quantities, "list the quantities of a CSV row and of ABS_TELEMETRY",
             {.excludes = {"--keys"}});
  parser.add("--reasons", &o->reasons, "list the reasons of phase changes, ends of runs and refused commands",
             {.excludes = {"--keys", "--quantities"}});
  parser.add("--json", &o->json, "print keys, quantities or reasons as JSON");
  return [o, parser] {
    if (o->json && !o->quantities && !o->reasons && !o->keys) {
      return parser.refuse("--json requires --keys, --quantities or --reasons");
    }
    if (o->json) {
      cli::print("{}\n", (o->quantities ? quantities() : o->reasons ? reasons() : keys()).dump(1));
    } else if (o->quantities) {
      list_quantities();
    } else if (o->reasons) {
      list_reasons();
    } else if (o->keys) {
      list_keys();
    } else {
      list_names();
    }
    return int{exit_completed};
  };
}

}  // namespace abs_hil::program

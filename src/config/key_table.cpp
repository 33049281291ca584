// Values of the configuration by their dotted names: setting with checks, printing as TOML, to and from JSON.
#include "config/key_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "abs_hil/rig/option_check.hpp"
#include "config/config_error.hpp"
#include "rig/formatted_text.hpp"
#include "rig/nearest_name.hpp"
#include "rig/parse_json.hpp"

namespace abs_hil::config {

namespace {

/// The value as it was given, for messages.
std::string as_given(const Value& value) {
  return std::holds_alternative<std::string>(value) ? '"' + text_of(value) + '"' : text_of(value);
}

[[noreturn]] void refuse(const Key& key, std::string_view value, std::string_view valid, std::string_view origin) {
  throw ConfigError(fmt::format("{}: {}", origin, rig::refusal(key.name, value, valid, key)));
}

/// ", nearest to it x" if the text looks like one of the allowed names.
std::string nearest_of(const Key& key, const std::string* text) {
  const std::string_view nearest = text == nullptr ? "" : rig::nearest_name(*text, key.allowed.list());
  if (nearest.empty() || 2 * rig::edit_distance(*text, nearest) > text->size()) return {};
  return fmt::format(", nearest to it {}", nearest);
}

template <typename Number>
void assign_number(const Key& key, Number& target, const Value& value, std::string_view origin) {
  constexpr bool whole = std::is_integral_v<Number>;
  const std::optional<double> number = number_of(value);
  if (!number || !key.range.contains(*number) || (whole && *number != std::floor(*number))) {
    refuse(key, as_given(value), rig::valid_number_text(key, whole), origin);
  }
  target = static_cast<Number>(*number);
}

/// Reads a value as TOML would: a flag, a whole number or a number, otherwise text.
Value parse_value(std::string_view text) {
  if (text == "true" || text == "false") return text == "true";
  if (text.starts_with("0x") || text.starts_with("0X")) {
    if (const auto hexadecimal = rig::parse_number<std::int64_t>(text.substr(2), 16)) return *hexadecimal;
  }
  if (const auto integer = rig::parse_number<std::int64_t>(text)) return *integer;
  if (const auto real = rig::parse_number<double>(text)) return *real;
  return std::string(text);
}

void copy(const Key& from, const Key& to) {
  std::visit([&from](auto* target) { *target = *std::get<std::remove_cvref_t<decltype(target)>>(from.target); },
             to.target);
}

constexpr std::string_view plant_prefix = "plant.";
constexpr std::string_view model_prefix = "model.";
constexpr std::string_view identity_prefix = "rig.";

void set_values(const nlohmann::ordered_json& node, const std::string& name, KeyTable& table, std::string_view origin,
                std::vector<std::string>& unknown) {
  if (node.is_object()) {
    for (const auto& [key, value] : node.items()) {
      set_values(value, name.empty() ? key : fmt::format("{}.{}", name, key), table, origin, unknown);
    }
    return;
  }
  if (find_key(table.keys(), name) == nullptr) {
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

KeyTable::KeyTable(Settings& settings) {
  keys_.reserve(512);  // about as many as there are; growing would touch twice the memory
  rig::for_each_option(settings, {}, [this](const std::string& name, const rig::OptionFacts& facts, auto& value) {
    keys_.push_back({facts, name, &value});
  });
  if (settings.model == settings.plant.rig) return;
  for (const Key& key : keys_) {
    const Key* model = model_key(keys_, key.name);
    if (model != nullptr && value_of(*model) != value_of(key)) set_.insert(model->name);
  }
}

const Key* find_key(const std::vector<Key>& keys, std::string_view name) {
  const auto at = std::find_if(keys.begin(), keys.end(), [name](const Key& key) { return key.name == name; });
  return at == keys.end() ? nullptr : &*at;
}

const Key* model_key(const std::vector<Key>& keys, std::string_view name) {
  if (!name.starts_with(plant_prefix)) return nullptr;
  return find_key(keys, std::string(model_prefix).append(name.substr(plant_prefix.size())));
}

Value value_of(const Key& key) {
  return std::visit([](const auto* target) { return Value(*target); }, key.target);
}

std::optional<double> number_of(const Value& value) {
  if (const auto* integer = std::get_if<std::int64_t>(&value)) return static_cast<double>(*integer);
  const auto* real = std::get_if<double>(&value);
  return real == nullptr ? std::nullopt : std::optional(*real);
}

std::string text_of(const Value& value) {
  return std::visit([](const auto& v) { return fmt::format("{}", v); }, value);
}

nlohmann::ordered_json json_of(const Value& value) {
  return std::visit([](const auto& v) { return nlohmann::ordered_json(v); }, value);
}

std::string toml_of(const Value& value) {
  // A number gets the shortest form that reads back to the same value. TOML reads a text as JSON writes it.
  return std::holds_alternative<std::string>(value) ? json_of(value).dump() : text_of(value);
}

rig::SafetyClass safety_of(const Key& key) {
  using Kind = rig::SafetyClass::Kind;
  if (key.safety.kind != Kind::unclassed) return key.safety;
  if (key.name.starts_with(identity_prefix)) return rig::commissioned;
  constexpr std::array<std::string_view, 3> judged{"run.inject", "control.controller", "model.encoder_counts_per_rev"};
  if (std::ranges::find(judged, key.name) != judged.end()) return rig::judged_elsewhere;
  const auto begins = [&key](std::string_view table) { return key.name.starts_with(table); };
  const bool of_the_run = begins(plant_prefix) || begins(model_prefix) || begins("control.") || begins("telemetry.") ||
                          begins("commands.") || begins("run.");
  return of_the_run ? rig::no_effect_on_safety : key.safety;
}

std::string number_text(const Settings& settings, std::string_view name) {
  Settings copy = settings;
  const KeyTable keys(copy);
  const Key* key = find_key(keys.keys(), name);
  return key == nullptr || std::holds_alternative<std::string*>(key->target) ? std::string() : text_of(value_of(*key));
}

Value parse_value(const Key& key, std::string_view text) {
  return std::holds_alternative<std::string*>(key.target) ? Value(std::string(text)) : parse_value(text);
}

const Key& KeyTable::find(std::string_view name, std::string_view origin) const {
  if (const Key* key = find_key(keys_, name)) return *key;
  std::vector<std::string_view> names;
  for (const Key& key : keys_) {
    if (has_plant_ || !key.name.starts_with(plant_prefix)) names.push_back(key.name);
  }
  throw ConfigError(fmt::format("{}: unknown key {}; the nearest known key is {} (abs_hil list --keys shows all)",
                                origin, name, fmt::join(rig::nearest_keys(name, names), " or ")));
}

void KeyTable::refuse_plant(std::string_view name, std::string_view origin) const {
  if (has_plant_ || !name.starts_with(plant_prefix)) return;
  if (const Key* model = model_key(keys_, name)) {
    throw ConfigError(fmt::format("{}: {}: a rig has no simulated plant; set {}, the value that the controllers use",
                                  origin, name, model->name));
  }
  throw ConfigError(
      fmt::format("{}: {}: only a simulated plant has this value; leave it out or use --backend sim", origin, name));
}

void KeyTable::carry_over(const Key& key) {
  if (const Key* model = model_key(keys_, key.name)) {
    if (!set_.contains(model->name)) copy(key, *model);
  } else if (!has_plant_ && key.name.starts_with(model_prefix)) {
    copy(key, *find_key(keys_, std::string(plant_prefix).append(key.name.substr(model_prefix.size()))));
  }
}

void KeyTable::leave_out_plant() {
  has_plant_ = false;
  for (const Key& key : keys_) {
    if (key.name.starts_with(model_prefix)) carry_over(key);
  }
}

bool KeyTable::is_effective(const Key& key) const {
  if (key.name.starts_with(plant_prefix)) return has_plant_;
  if (key.name.starts_with(identity_prefix)) return !has_plant_;
  return !has_plant_ || !key.name.starts_with(model_prefix) || set_.contains(key.name);
}

void KeyTable::set(std::string_view name, const Value& value, std::string_view origin) {
  const Key& key = find(name, origin);
  refuse_plant(name, origin);
  std::visit(
      [&](auto* target) {
        using Target = std::decay_t<decltype(*target)>;
        if constexpr (std::is_same_v<Target, bool>) {
          const auto* flag = std::get_if<bool>(&value);
          if (flag == nullptr) refuse(key, as_given(value), "true or false", origin);
          *target = *flag;
        } else if constexpr (std::is_same_v<Target, std::string>) {
          const auto* text = std::get_if<std::string>(&value);
          if (text == nullptr || !key.allows(*text)) {
            refuse(key, as_given(value), rig::valid_name_text(key) + nearest_of(key, text), origin);
          }
          if (!rig::is_utf8(*text)) {
            throw ConfigError(fmt::format("{}: {} is not UTF-8 text; give UTF-8 ({})", origin, key.name, key.meaning));
          }
          *target = *text;
        } else {
          assign_number(key, *target, value, origin);
        }
      },
      key.target);
  set_.emplace(name);
  carry_over(key);
}

std::pair<std::string, Value> KeyTable::parsed(std::string_view assignment, std::string_view origin) const {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos || equals == 0) {
    throw ConfigError(
        fmt::format("{}: \"{}\" is not an assignment; write key=value, as in plant.theta_N=30", origin, assignment));
  }
  const std::string_view name = rig::trimmed(assignment.substr(0, equals));
  return {std::string(name), parse_value(find(name, origin), rig::trimmed(assignment.substr(equals + 1)))};
}

void KeyTable::set_text(std::string_view assignment, std::string_view origin) {
  const auto [name, value] = parsed(assignment, origin);
  set(name, value, origin);
}

std::string KeyTable::to_toml() const {
  // Each table is written once. The tables have the order of their first keys.
  std::vector<std::pair<std::string_view, std::string>> tables;
  for (const Key& key : keys_) {
    if (!is_effective(key)) continue;
    const std::size_t dot = key.name.rfind('.');
    const std::string_view table = std::string_view(key.name).substr(0, dot);
    auto at = std::find_if(tables.begin(), tables.end(), [&](const auto& known) { return known.first == table; });
    if (at == tables.end()) at = tables.insert(tables.end(), {table, fmt::format("\n[{}]\n", table)});
    at->second += fmt::format("{} = {}\n", key.name.substr(dot + 1), toml_of(value_of(key)));
  }
  std::string text;
  for (const auto& [name, values] : tables) text += values;
  return text;
}

nlohmann::ordered_json KeyTable::to_json() const {
  nlohmann::ordered_json root;
  for (const Key& key : keys_) {
    if (!is_effective(key)) continue;
    nlohmann::ordered_json* node = &root;
    std::string_view rest = key.name;
    for (std::size_t dot = rest.find('.'); dot != std::string_view::npos; dot = rest.find('.')) {
      node = &(*node)[std::string(rest.substr(0, dot))];
      rest.remove_prefix(dot + 1);
    }
    (*node)[std::string(rest)] = json_of(value_of(key));
  }
  return root;
}

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

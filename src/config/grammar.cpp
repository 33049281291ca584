// The keys of a table as a file may spell them, and the units of its numbers. The JSON Schema of experiments, from the
// rows that the reader uses.
#include "config/grammar.hpp"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "config/key_table.hpp"
#include "config/script.hpp"

namespace abs_hil::config {

namespace {

struct Unit {
  std::string_view si_unit;
  std::string_view name;
  double si;  ///< of one such unit
};

constexpr std::array<Unit, 14> units{{
    {"", "%", 0.01},
    {"s", "s", 1.0},
    {"s", "ms", 1e-3},
    {"s", "min", 60.0},
    {"rad/s", "rad/s", 1.0},
    {"rad/s", "rpm", std::numbers::pi / 30.0},
    {"m/s", "m/s", 1.0},
    {"m/s", "km/h", 1.0 / 3.6},
    {"m", "m", 1.0},
    {"m", "cm", 1e-2},
    {"m", "mm", 1e-3},
    {"N m", "N m", 1.0},
    {"N m", "Nm", 1.0},
    {"N m", "mN m", 1e-3},
}};

using Json = nlohmann::ordered_json;

const Json reference{{"type", "string"}, {"pattern", "^\\$[a-z]"}, {"description", "value of a configuration key"}};

Json bounds(const rig::Range& range) {
  return {{"type", "number"},
          {range.least_open ? "exclusiveMinimum" : "minimum", range.least},
          {range.most_open ? "exclusiveMaximum" : "maximum", range.most}};
}

/// A name for "$defs": letters and underscores only.
std::string definition_of(const Grammar& grammar) {
  std::string name;
  for (const char c : grammar.title) {
    if ((c >= 'a' && c <= 'z') || c == ' ') name += c == ' ' ? '_' : c;
  }
  return name;
}

Json pointer_to(const Grammar& grammar) { return {{"$ref", "#/$defs/" + definition_of(grammar)}}; }

Json with_unit(const Field& field) {
  return {{"type", "string"}, {"description", "a number with one of the units " + units_text(field.facts.unit)}};
}

Json number(const Field& field, bool unit_is_named) {
  if (unit_is_named) return {{"anyOf", {bounds(field.facts.range), reference}}};
  if (field.facts.unit.empty()) return {{"anyOf", {bounds(field.facts.range), with_unit(field), reference}}};
  return {{"anyOf", {with_unit(field), reference}}};
}

Json list_of(Json items) { return {{"type", "array"}, {"items", std::move(items)}, {"minItems", 1}}; }

/// A text that names a file with one of the endings.
Json files_of(const rig::FileEndings& files) {
  std::string pattern;
  for (const std::string_view ending : files.endings) {
    if (ending.empty()) continue;
    pattern.append(pattern.empty() ? "" : "|");
    if (ending == rig::FileEndings::python_class) {
      pattern.append("^[A-Za-z0-9_.]+:[A-Za-z0-9_]+$");
    } else {
      pattern.append(".\\").append(ending).append("$");
    }
  }
  return {{"type", "string"}, {"pattern", pattern}};
}

Json schema_of(const Key& key) {
  Json json = std::visit(
      [&key](const auto* target) -> Json {
        using Target = std::decay_t<decltype(*target)>;
        if constexpr (std::is_same_v<Target, bool>) return {{"type", "boolean"}};
        if constexpr (std::is_same_v<Target, std::string>) {
          if (key.allowed.empty()) return {{"type", "string"}};
          Json names{{"enum", key.allowed.list()}};
          return key.files.endings.front().empty() ? names : Json{{"anyOf", {names, files_of(key.files)}}};
        }
        Json number = bounds(key.range);
        if constexpr (std::is_integral_v<Target>) number["type"] = "integer";
        return number;
      },
      key.target);
  json["description"] = std::string(key.meaning) + (key.unit.empty() ? "" : ", in ") + std::string(key.unit);
  return json;
}

/// The configuration keys that a script may set, nested as in a file. Names with dots in quotes are allowed as well.
Json settings_table() {
  Settings defaults;
  Json json{{"type", "object"}};
  const KeyTable table(defaults);
  for (const Key& key : table.keys()) {
    if (!script_may_set(key.name)) continue;
    Json* place = &json;
    for (std::size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
      end = key.name.find('.', begin);
      place = &(*place)["properties"][key.name.substr(begin, end - begin)];
      if (end != std::string::npos) (*place)["type"] = "object";
    }
    *place = schema_of(key);
  }
  return json;
}

Json whole(const Field& field) {
  Json json = bounds(field.facts.range);
  json["type"] = "integer";
  return json;
}

/// A profile or a table, or one of the texts that the row allows in its place.
Json or_text(const Field& field, Json json) {
  if (field.facts.allowed.empty()) return json;
  if (!json.contains("anyOf")) json = {{"anyOf", {std::move(json)}}};
  json["anyOf"].push_back({{"enum", field.facts.allowed.list()}});
  return json;
}

Json value_of(const Field& field, bool unit_is_named) {
  switch (field.shape) {
    case Shape::text:
      return field.facts.allowed.empty() ? Json{{"type", "string"}} : Json{{"enum", field.facts.allowed.list()}};
    case Shape::condition: return {{"type", "string"}};
    case Shape::flag_true: return {{"const", true}};
    case Shape::number: return number(field, unit_is_named);
    case Shape::whole: return whole(field);
    case Shape::texts: return list_of({{"type", "string"}});
    case Shape::wholes: return list_of(whole(field));
    case Shape::profile: {
      Json json = number(field, unit_is_named);
      json["anyOf"].push_back(pointer_to(grammar_of<ProfileForm>()));
      return or_text(field, std::move(json));
    }
    case Shape::table: return or_text(field, pointer_to(field.grammar()));
    case Shape::tables: return list_of(pointer_to(field.grammar()));
    case Shape::points:
      return list_of(
          {{"type", "array"}, {"minItems", 2}, {"maxItems", 2}, {"items", {{"type", {"number", "string"}}}}});
    case Shape::settings: return settings_table();
    case Shape::factors: return {{"type", "object"}};
  }
  return {};
}

Json table(const Grammar& grammar) {
  Json properties = Json::object();
  Json required = Json::array();
  for (const Field& field : grammar.fields) {
    const auto add = [&](const std::string& name, bool unit_is_named) {
      Json json = value_of(field, unit_is_named);
      json["description"] = field.facts.meaning;
      properties[name] = std::move(json);
    };
    const std::string key(field.facts.key);
    add(key, false);
    if (!field.facts.unit.empty()) add(key + suffix_of(field.facts.unit), true);
    if (field.required) required.push_back(key);
  }
  Json json{{"type", "object"}, {"description", grammar.meaning}, {"properties", std::move(properties)}};
  if (!required.empty()) json["required"] = std::move(required);
  json["additionalProperties"] = false;
  return json;
}

/// Defines the tables below a table, and itself if it has a name.
void define_below(const Grammar& grammar, Json& definitions) {
  for (const Field& field : grammar.fields) {
    const Grammar* below = field.shape == Shape::profile ? &grammar_of<ProfileForm>()
                           : field.grammar != nullptr    ? &field.grammar()
                                                         : nullptr;
    if (below == nullptr || definitions.contains(definition_of(*below))) continue;
    definitions[definition_of(*below)] = table(*below);
    define_below(*below, definitions);
  }
}

}  // namespace

const Field* Grammar::find(std::string_view name) const noexcept {
  const auto at = std::ranges::find_if(fields, [name](const Field& field) {
    if (!name.starts_with(field.facts.key)) return false;
    const std::string_view rest = name.substr(field.facts.key.size());
    return rest.empty() || rest == suffix_of(field.facts.unit);
  });
  return at == fields.end() ? nullptr : &*at;
}

std::vector<std::string> Grammar::spellings() const {
  std::vector<std::string> names;
  for (const Field& field : fields) {
    names.emplace_back(field.facts.key);
    if (!field.facts.unit.empty()) names.push_back(names.back() + suffix_of(field.facts.unit));
  }
  return names;
}

std::string table_below_with(const Grammar& start, std::string_view key) {
  // Breadth first: the nearest table counts. The grammar of `until` contains itself, so no grammar is taken twice.
  std::vector<std::pair<const Grammar*, std::string>> open{{&start, ""}};
  for (std::size_t n = 0; n < open.size(); ++n) {
    const auto [grammar, path] = open[n];
    for (const Field& field : grammar->fields) {
      const Grammar* below = field.grammar == nullptr ? nullptr : &field.grammar();
      const auto is_it = [below](const auto& other) { return other.first == below; };
      if (below == nullptr || std::ranges::any_of(open, is_it)) continue;
      std::string name = path + (path.empty() ? "" : ".") + std::string(field.facts.key);
      if (below->find(key) != nullptr) return name;
      open.emplace_back(below, std::move(name));
    }
  }
  return {};
}

std::string suffix_of(std::string_view unit) {
  std::string suffix(unit.empty() ? "" : "_");
  for (const char c : unit) {
    if (c != ' ') suffix += c == '/' ? '_' : c;
  }
  return suffix;
}

std::string units_text(std::string_view unit) {
  std::string text;
  for (const Unit& known : units) {
    if (known.si_unit == unit) text.append(text.empty() ? "" : ", ").append(known.name);
  }
  return text;
}

std::optional<double> parse_quantity(std::string_view text, std::string_view unit) noexcept {
  double number = 0.0;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc()) return std::nullopt;
  std::string_view name(at, static_cast<std::size_t>(end - at));
  while (name.starts_with(' ')) name.remove_prefix(1);
  for (const Unit& known : units) {
    // 20 / 1000 rounds once; 20 * 0.001 rounds twice, because 0.001 is not exact.
    if (known.si_unit == unit && known.name == name) {
      const double divisor = std::round(1.0 / known.si);
      return known.si < 1.0 && divisor * known.si == 1.0 ? number / divisor : number * known.si;
    }
  }
  return std::nullopt;
}

Json schema() {
  Json json{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "Experiment of abs_hil"}};
  json.update(table(grammar_of<Script>()));
  Json definitions = Json::object();
  define_below(grammar_of<Script>(), definitions);
  json["$defs"] = std::move(definitions);
  return json;
}

}  // namespace abs_hil::config

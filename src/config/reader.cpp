#include "config/reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "abs_hil/rig/option_check.hpp"
#include "config/config_error.hpp"
#include "rig/nearest_name.hpp"

namespace abs_hil::config {

namespace {

constexpr std::size_t longest_shown = 60;

/// "lasts_s = 2 or lasts = "2 s"" for the key of a quantity.
std::string with_unit(const Field& field, std::string_view name, double example) {
  return fmt::format("{}{} = {} or {} = \"{} {}\"", name, suffix_of(field.quantity), example, name, example,
                     field.facts.unit);
}

std::string quoted(const std::vector<std::string_view>& names) {
  std::string text;
  for (const std::string_view name : names) text += fmt::format("{}\"{}\"", text.empty() ? "" : ", ", name);
  return text;
}

/// Where an unknown key belongs if another table knows it; otherwise the nearest key.
std::string advice(const Source& source, std::string_view key, const toml::node& node, const Grammar& grammar,
                   const std::vector<std::string>& names) {
  const std::string value = node.is_table() || node.is_array() ? "..." : shown(node);
  if (const std::string below = table_below_with(grammar, key); !below.empty()) {
    return fmt::format("put it into {}: {} = {{ {} = {} }}", below, below, key, value);
  }
  if (const std::string place = table_below_with(script_grammar(), key); !place.empty()) {
    return fmt::format("it belongs into the table {}", place);
  }
  if (source.is_setting(key)) {
    return "put it into [settings], which takes the keys of abs_hil list --keys";
  }
  return fmt::format("the nearest known key is \"{}\"", rig::nearest_name(key, names));
}

}  // namespace

std::string Source::at(Place place) const { return fmt::format("{}:{}:{}", path_, place.line, place.column); }

void Source::fail(Place place, std::string_view message) const {
  std::string text = fmt::format("{}: {}", at(place), message);
  // A quoted key may contain a line end, but a message is one line.
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) == 0x7F) c = ' ';
  }
  throw config::ConfigError(text);
}

const config::Key& Source::key(std::string_view name, Place place) const {
  std::vector<std::string_view> names;
  for (const config::Key& key : keys_.keys()) {
    if (key.name == name) return key;
    names.push_back(key.name);
  }
  fail(place,
       fmt::format("unknown configuration key \"{}\"; the nearest known key is \"{}\" (abs_hil list --keys shows all)",
                   name, fmt::join(rig::nearest_keys(name, names), "\" or \"")));
}

bool Source::is_setting(std::string_view name) const {
  const auto is_it = [table = std::string(name) + '.', name](const config::Key& key) {
    return key.name == name || key.name.starts_with(table);
  };
  return std::any_of(keys_.keys().begin(), keys_.keys().end(), is_it);
}

void Source::check_value(std::string_view name, const config::Value& value, Place place) const {
  keys_.set(name, value, at(place));
}

std::string shown(const toml::node& node) {
  std::ostringstream stream;
  node.visit([&stream](const auto& value) { stream << value; });
  std::string text = stream.str();
  // A message is one line of UTF-8.
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) == 0x7F) c = ' ';
  }
  if (text.size() > longest_shown) {
    std::size_t end = longest_shown;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
    text.resize(end);
    text += "...";
  }
  return text;
}

std::string_view kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::table: return "a table";
    case toml::node_type::array: return "a list";
    case toml::node_type::string: return "a text";
    case toml::node_type::integer: return "a whole number";
    case toml::node_type::floating_point: return "a number";
    case toml::node_type::boolean: return "a flag";
    default: return "a date or time";
  }
}

TableReader::TableReader(const Source& source, const toml::table& table, const Grammar& grammar, Place place)
    : source_(source), place_(table.source().begin.line > 0 ? place_of(table.source()) : place) {
  for (const auto& [key, node] : table) {
    Entry entry{.field = grammar.find(key.str()),
                .key = std::string(key.str()),
                .node = &node,
                .place = place_of(node.source()),
                .key_place = place_of(key.source())};
    if (entry.field == nullptr) {
      const std::vector<std::string> names = grammar.spellings();
      source.fail(entry.key_place,
                  fmt::format("unknown key \"{}\" in {}; {}; known: {}", entry.key, grammar.title,
                              advice(source, entry.key, node, grammar, names), fmt::join(names, ", ")));
    }
    entry.has_suffix = entry.key.size() > entry.field->facts.key.size();
    if (const Entry* other = find(entry.field->facts.key)) {
      source.fail(entry.key_place,
                  fmt::format("{} and {} say the same thing; leave one of them out", other->key, entry.key));
    }
    entries_.push_back(std::move(entry));
  }
  // toml++ does not keep the order of the file.
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return std::pair(a.key_place.line, a.key_place.column) < std::pair(b.key_place.line, b.key_place.column);
  });
  for (const Field& field : grammar.fields) {
    if (field.required && find(field.facts.key) == nullptr) {
      source.fail(place_,
                  fmt::format("{} has no \"{}\" ({}); give one", grammar.title, field.facts.key, field.facts.meaning));
    }
  }
}

const Entry* TableReader::find(std::string_view name) const noexcept {
  const auto at =
      std::find_if(entries_.begin(), entries_.end(), [name](const Entry& e) { return e.field->facts.key == name; });
  return at == entries_.end() ? nullptr : &*at;
}

std::string TableReader::text(const Entry& entry) const {
  const auto* text = entry.node->as_string();
  if (text == nullptr) {
    source_.fail(entry.place, fmt::format("{} = {}: give a text in quotes ({})", entry.key, shown(*entry.node),
                                          entry.field->facts.meaning));
  }
  return text->get();
}

std::string TableReader::choice(const Entry& entry) const {
  const rig::AllowedNames& allowed = entry.field->facts.allowed;
  const auto* text = entry.node->as_string();
  if (text == nullptr || !allowed.contains(text->get())) {
    source_.fail(entry.place, fmt::format("{} = {}: give one of {} ({})", entry.key, shown(*entry.node),
                                          quoted(allowed.list()), entry.field->facts.meaning));
  }
  return text->get();
}

Number TableReader::number(const Entry& entry) const {
  return read_number(source_, *entry.node, *entry.field, entry.key, entry.has_suffix);
}

std::int64_t TableReader::whole(const Entry& entry) const {
  const auto* number = entry.node->as_integer();
  if (number == nullptr || !entry.field->facts.range.contains(static_cast<double>(number->get()))) {
    source_.fail(entry.place, fmt::format("{} = {}: give a whole number in {} ({})", entry.key, shown(*entry.node),
                                          entry.field->facts.range.text(), entry.field->facts.meaning));
  }
  return number->get();
}

std::vector<std::string> TableReader::texts(const Entry& entry) const {
  std::vector<std::string> all;
  if (const auto* list = entry.node->as_array()) {
    for (const toml::node& node : *list) {
      const auto* text = node.as_string();
      if (text == nullptr || text->get().empty()) {
        source_.fail(place_of(node.source()), fmt::format("{} holds {}: give texts in quotes", entry.key, shown(node)));
      }
      all.push_back(text->get());
    }
  }
  if (all.empty()) {
    source_.fail(entry.place, fmt::format("{} = {}: give a list of texts ({})", entry.key, shown(*entry.node),
                                          entry.field->facts.meaning));
  }
  return all;
}

std::vector<std::int64_t> TableReader::wholes(const Entry& entry) const {
  std::vector<std::int64_t> numbers;
  if (const auto* list = entry.node->as_array()) {
    for (const toml::node& node : *list) {
      const auto* number = node.as_integer();
      if (number == nullptr || !entry.field->facts.range.contains(static_cast<double>(number->get()))) {
        source_.fail(place_of(node.source()), fmt::format("{} holds {}: give whole numbers in {}", entry.key,
                                                          shown(node), entry.field->facts.range.text()));
      }
      numbers.push_back(number->get());
    }
  }
  if (numbers.empty()) {
    source_.fail(entry.place, fmt::format("{} = {}: give a list of whole numbers, [1, 2, 3] ({})", entry.key,
                                          shown(*entry.node), entry.field->facts.meaning));
  }
  return numbers;
}

When TableReader::when(const Entry& entry) const {
  const std::string text = this->text(entry);
  // Two-character operations first: "<" is the beginning of "<=".
  for (const std::string_view operation : {"!=", "<=", ">=", "=", "<", ">"}) {
    const std::size_t found = text.find(operation);
    if (found == std::string::npos) continue;
    const auto trimmed = [](std::string_view part) {
      while (part.starts_with(' ')) part.remove_prefix(1);
      while (part.ends_with(' ')) part.remove_suffix(1);
      return std::string(part);
    };
    const std::string_view all = text;
    When when{trimmed(all.substr(0, found)), std::string(operation), trimmed(all.substr(found + operation.size())),
              entry.place};
    const config::Key& key = source_.key(when.key, entry.place);
    const config::Value value = config::parse_value(key, when.value);
    source_.check_value(when.key, value, entry.place);
    const bool ordered =
        !std::holds_alternative<std::string*>(key.target) && !std::holds_alternative<bool*>(key.target);
    if (!ordered && operation != "=" && operation != "!=") {
      source_.fail(entry.place, fmt::format("when = \"{}\": {} is no number; compare it with = or !=", text, when.key));
    }
    return when;
  }
  source_.fail(entry.place,
               fmt::format("when = \"{}\": give a comparison, \"KEY = VALUE\", with one of = != < > <= >=", text));
}

const toml::table& TableReader::table(const Entry& entry) const {
  const auto* table = entry.node->as_table();
  if (table == nullptr) {
    source_.fail(entry.place,
                 fmt::format("{} = {}: give a table ({})", entry.key, shown(*entry.node), entry.field->facts.meaning));
  }
  return *table;
}

std::vector<const toml::table*> TableReader::tables(const Entry& entry) const {
  std::vector<const toml::table*> tables;
  if (const auto* list = entry.node->as_array()) {
    for (const toml::node& node : *list) {
      if (!node.is_table()) {
        source_.fail(place_of(node.source()), fmt::format("{} holds {}: give tables only", entry.key, shown(node)));
      }
      tables.push_back(node.as_table());
    }
  }
  if (tables.empty()) {
    source_.fail(entry.place, fmt::format("{} is {}: give a list of tables ({})", entry.key,
                                          entry.node->is_array() ? "an empty list" : kind_of(*entry.node),
                                          entry.field->facts.meaning));
  }
  return tables;
}

std::string TableReader::text_or_empty(std::string_view name) const {
  const Entry* entry = find(name);
  return entry == nullptr ? std::string() : text(*entry);
}

std::optional<Number> TableReader::optional_number(std::string_view name) const {
  const Entry* entry = find(name);
  return entry == nullptr ? std::nullopt : std::optional(number(*entry));
}

std::optional<When> TableReader::optional_when() const {
  const Entry* entry = find("when");
  return entry == nullptr ? std::nullopt : std::optional(when(*entry));
}

Number read_number(const Source& source, const toml::node& node, const Field& field, std::string_view what,
                   bool unit_is_named) {
  const Place place = place_of(node.source());
  Number number{.unit = field.facts.unit, .range = field.facts.range, .place = place};
  const std::string_view base = what.substr(0, field.facts.key.size());
  const auto refuse = [&] {
    source.fail(place, rig::refusal(what, shown(node), rig::valid_number_text(field.facts, false), field.facts));
  };
  if (const auto* text = node.as_string()) {
    if (text->get().starts_with('$')) {
      number.key = text->get().substr(1);
      const config::Key& key = source.key(number.key, place);
      const bool is_number = std::holds_alternative<double*>(key.target);
      if (!is_number || key.unit != number.unit) {
        source.fail(place, fmt::format("{} = {}: {} {}; give a key in {}", what, shown(node), number.key,
                                       is_number ? fmt::format("is in {}", key.unit.empty() ? "no unit" : key.unit)
                                                 : "is no real number",
                                       number.unit.empty() ? "no unit" : number.unit));
      }
      return number;
    }
    if (unit_is_named) {
      source.fail(place, fmt::format("{} = {}: the key names the unit already; write {}", what, shown(node),
                                     with_unit(field, base, 2)));
    }
    const std::optional<double> value = parse_quantity(text->get(), field.quantity);
    if (!value) {
      source.fail(place, fmt::format("{} = {}: give a number with one of the units {} ({})", what, shown(node),
                                     units_text(field.quantity), field.facts.meaning));
    }
    number.value = *value;
  } else if (const auto real = node.is_number() ? node.value<double>() : std::nullopt) {
    if (field.quantity != Quantity::none && !unit_is_named) {
      source.fail(place,
                  fmt::format("{} = {} has no unit; write {}", what, shown(node), with_unit(field, base, *real)));
    }
    number.value = *real;
  } else {
    refuse();
  }
  if (!field.facts.range.contains(number.value)) refuse();
  return number;
}

}  // namespace abs_hil::config

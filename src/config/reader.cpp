// The keys of one table of an experiment or a study, and the forms of their values.
#include "config/reader.hpp"

#include <fmt/format.h>

#include <sstream>

#include "abs_hil/rig/option_check.hpp"
#include "config/config_error.hpp"
#include "rig/formatted_text.hpp"
#include "rig/nearest_name.hpp"
#include "rig/parse_toml.hpp"

namespace abs_hil::config {

namespace {

constexpr std::size_t longest_shown = 60;

/// "lasts_s = 2 or lasts = "2 s"" for the key of a quantity.
std::string with_unit(std::string_view unit, std::string_view name, double example) {
  return fmt::format("{}{} = {} or {} = \"{} {}\"", name, suffix_of(unit), example, name, example, unit);
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
  if (const std::string place = table_below_with(grammar_of<Script>(), key); !place.empty()) {
    return fmt::format("it belongs into the table {}", place);
  }
  if (source.is_setting(key)) {
    return "put it into [settings], which takes the keys of abs_hil list --keys";
  }
  return fmt::format("the nearest known key is \"{}\"", rig::nearest_name(key, names));
}

/// The node as a whole number in the row's range; nothing for anything else.
std::optional<std::int64_t> whole_in(const toml::node& node, const rig::Range& range) {
  const auto* number = node.as_integer();
  return number != nullptr && range.contains(static_cast<double>(number->get())) ? std::optional(number->get())
                                                                                 : std::nullopt;
}

/// The elements of a list as `read` makes them: nothing of one that is not valid. Refuses an empty list, too.
/// @param whole  what to give in place of the list @param each  in place of an element
template <class Value, class Read>
std::vector<Value> elements(const TableReader& reader, const Entry& entry, std::string_view whole,
                            const std::string& each, const Read& read) {
  std::vector<Value> all;
  const auto* list = entry.node->as_array();
  for (std::size_t n = 0; list != nullptr && n < list->size(); ++n) {
    const toml::node& node = (*list)[n];
    std::optional<Value> value = read(node);
    if (!value) reader.fail(place_of(node.source()), fmt::format("{} holds {}: give {}", entry.key, shown(node), each));
    all.push_back(std::move(*value));
  }
  if (all.empty()) {
    const std::string given =
        entry.node->is_table() ? entry.key + " is a table" : fmt::format("{} = {}", entry.key, shown(*entry.node));
    reader.fail(entry.place, fmt::format("{}: give a list of {} ({})", given, whole, entry.field->facts.meaning));
  }
  return all;
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

const Key& Source::key(std::string_view name, Place place) const {
  if (const Key* key = find_key(keys_.keys(), name)) return *key;
  std::vector<std::string_view> names;
  for (const Key& key : keys_.keys()) names.push_back(key.name);
  fail(place,
       fmt::format("unknown configuration key \"{}\"; the nearest known key is \"{}\" (abs_hil list --keys shows all)",
                   name, fmt::join(rig::nearest_keys(name, names), "\" or \"")));
}

bool Source::is_setting(std::string_view name) const {
  return std::ranges::any_of(keys_.keys(), [table = std::string(name) + '.', name](const Key& key) {
    return key.name == name || key.name.starts_with(table);
  });
}

void Source::check_value(std::string_view name, const Value& value, Place place) const {
  keys_.set(name, value, at(place));
}

toml::table Source::parsed(const std::string& text) const try {
  return rig::parse_toml(text, path_);
} catch (const toml::parse_error& problem) {
  fail(place_of(problem.source()), fmt::format("not valid TOML: {}", problem.description()));
}

std::optional<std::string> Source::named_file(const std::string& name) const {
  std::optional<std::string> text = read_file_ ? read_file_(name) : std::nullopt;
  if (text) files_[name] = *text;
  return text;
}

std::string shown(const toml::node& node) {
  std::string text;
  if (const auto* real = node.as_floating_point()) {
    text = fmt::format("{}", real->get());
  } else if (const auto* list = node.as_array(); list != nullptr && !list->empty()) {
    for (const toml::node& element : *list) text.append(text.empty() ? "[ " : ", ").append(shown(element));
    text += " ]";
  } else {
    std::ostringstream stream;
    node.visit([&stream](const auto& value) { stream << value; });
    text = stream.str();
  }
  return rig::clean_text(text, longest_shown);
}

std::optional<Value> value_in(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* flag = node.as_boolean()) return flag->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* real = node.as_floating_point()) return real->get();
  return std::nullopt;
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

bool TableReader::is_allowed_text(const Entry& entry) noexcept {
  const rig::AllowedNames& allowed = entry.field->facts.allowed;
  const auto* text = entry.node->as_string();
  return text != nullptr && !allowed.empty() && allowed.contains(text->get());
}

void TableReader::read(const Entry& entry, std::string& text) const {
  const rig::OptionFacts& facts = entry.field->facts;
  const auto* given = entry.node->as_string();
  if (given == nullptr || !facts.allowed.contains(given->get())) {
    fail(entry.place, fmt::format("{} = {}: give {} ({})", entry.key, shown(*entry.node),
                                  facts.allowed.empty() ? "a text in quotes" : "one of " + quoted(facts.allowed.list()),
                                  facts.meaning));
  }
  text = given->get();
}

void TableReader::read(const Entry& entry, bool& flag) const {
  flag = entry.node->value_exact<bool>().value_or(false);
  if (!flag) fail(entry.place, fmt::format("{} = {}: write true", entry.key, shown(*entry.node)));
}

void TableReader::read(const Entry& entry, Number& number) const {
  number = read_number(source_, *entry.node, entry.field->facts, entry.key, entry.has_suffix);
}

void TableReader::read(const Entry& entry, double& number) const {
  const auto given = get<Number>(entry);
  if (!given.key.empty()) fail(given.place, fmt::format("{}: give a number, not a $key", entry.key));
  number = given.value;
}

std::int64_t TableReader::whole(const Entry& entry) const {
  const rig::OptionFacts& facts = entry.field->facts;
  const std::optional<std::int64_t> number = whole_in(*entry.node, facts.range);
  if (!number) {
    fail(entry.place, fmt::format("{} = {}: give a whole number in {} ({})", entry.key, shown(*entry.node),
                                  facts.range.text(), facts.meaning));
  }
  return *number;
}

void TableReader::read(const Entry& entry, std::vector<std::string>& texts) const {
  texts = elements<std::string>(*this, entry, "texts", "texts in quotes", [](const toml::node& node) {
    const auto* text = node.as_string();
    return text == nullptr || text->get().empty() ? std::nullopt : std::optional(text->get());
  });
}

void TableReader::read(const Entry& entry, std::vector<std::int64_t>& wholes) const {
  const rig::Range& range = entry.field->facts.range;
  wholes = elements<std::int64_t>(*this, entry, "whole numbers, [1, 2, 3]", "whole numbers in " + range.text(),
                                  [&range](const toml::node& node) { return whole_in(node, range); });
}

const toml::table& TableReader::table(const Entry& entry) const {
  const rig::OptionFacts& facts = entry.field->facts;
  const auto* table = entry.node->as_table();
  if (table == nullptr) {
    const std::string words = facts.allowed.empty() ? "" : quoted(facts.allowed.list()) + " or ";
    fail(entry.place, fmt::format("{} = {}: give {}a table ({})", entry.key, shown(*entry.node), words, facts.meaning));
  }
  return *table;
}

std::vector<const toml::table*> TableReader::tables(const Entry& entry) const {
  return elements<const toml::table*>(*this, entry, "tables", "tables only", [](const toml::node& node) {
    return node.is_table() ? std::optional(node.as_table()) : std::nullopt;
  });
}

Number read_number(const Source& source, const toml::node& node, const rig::OptionFacts& facts, std::string_view what,
                   bool unit_is_named) {
  const Place place = place_of(node.source());
  Number number{.unit = facts.unit, .range = facts.range, .place = place};
  const std::string_view base = what.substr(0, facts.key.size());
  const auto refuse = [&] {
    source.fail(place, rig::refusal(what, shown(node), rig::valid_number_text(facts, false), facts));
  };
  if (const auto* text = node.as_string()) {
    if (text->get().starts_with('$')) {
      number.key = text->get().substr(1);
      const Key& key = source.key(number.key, place);
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
                                     with_unit(facts.unit, base, 2)));
    }
    const std::optional<double> value = parse_quantity(text->get(), facts.unit);
    if (!value) {
      source.fail(place, fmt::format("{} = {}: give a number with one of the units {} ({})", what, shown(node),
                                     units_text(facts.unit), facts.meaning));
    }
    number.value = *value;
  } else if (const auto real = node.is_number() ? node.value<double>() : std::nullopt) {
    if (!facts.unit.empty() && !unit_is_named) {
      source.fail(place,
                  fmt::format("{} = {} has no unit; write {}", what, shown(node), with_unit(facts.unit, base, *real)));
    }
    number.value = *real;
  } else {
    refuse();
  }
  if (!facts.range.contains(number.value)) refuse();
  return number;
}

}  // namespace abs_hil::config

// Conditions of an experiment's file: `when`, over the configuration, and `until`, over the run.
#include <fmt/format.h>

#include "config/reader.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::config {

namespace {

using experiment::EndKind;

/// The row of this key; null for `when`, `any` and `all`.
const experiment::EndRow* row_with(std::string_view key) {
  const auto at = std::ranges::find(experiment::end_rows, key, &experiment::EndRow::key);
  return at == experiment::end_rows.end() ? nullptr : &*at;
}

/// `until` may hold a list any or all. A list any may hold lists all. Deeper lists are refused.
enum class Depth { until, any, all };

std::vector<ConditionScript> read_list(const TableReader& reader, const Entry& entry, Depth depth);

ConditionScript read_condition(const TableReader& reader, Depth depth) {
  ConditionScript condition;
  condition.place = reader.place();
  if (const Entry* when = reader.find("when")) condition.when = reader.get<When>(*when);
  const Entry* what = nullptr;
  for (const Entry& entry : reader.entries()) {
    if (entry.key == "when") continue;
    if (what != nullptr) {
      reader.fail(entry.key_place,
                  fmt::format("\"{}\" and \"{}\" in one condition; give any = [{{ ... }}, {{ ... }}] or all = "
                              "[{{ ... }}, {{ ... }}]",
                              what->key, entry.key));
    }
    what = &entry;
  }
  if (what == nullptr) {
    reader.fail(reader.place(),
                "an end condition is missing; give lasts_s, upper_speed_above_rad_s, car_speed_below_m_s, "
                "standstill, ... (docs/experiments.md)");
  }
  if (const experiment::EndRow* row = row_with(what->field->facts.key)) {
    condition.kind = static_cast<EndKind>(row - experiment::end_rows.data());
    if (row->takes_value()) {
      reader.read(*what, condition.value);
    } else {
      static_cast<void>(reader.get<bool>(*what));
    }
    return condition;
  }
  if (what->key == "any" || depth == Depth::all) {
    reader.fail(what->key_place,
                fmt::format("\"{}\" must not stand in this list; only any may hold a list, and only all", what->key));
  }
  condition.kind = EndKind::all;
  condition.parts = read_list(reader, *what, Depth::all);
  for (const ConditionScript& part : condition.parts) {
    // Without this condition the others would mean something else. The parser does not guess.
    if (part.when) reader.fail(part.place, "a condition within all takes no when; give the when to the list");
  }
  return condition;
}

std::vector<ConditionScript> read_list(const TableReader& reader, const Entry& entry, Depth depth) {
  std::vector<ConditionScript> list;
  for (const toml::table* table : reader.tables(entry)) {
    const TableReader inner(reader.source(), *table, grammar_of<ConditionScript>(), entry.place);
    list.push_back(read_condition(inner, depth));
  }
  return list;
}

}  // namespace

const Grammar& ConditionScript::grammar() {
  static const Grammar grammar = [] {
    Grammar made{title, meaning};
    for (const experiment::EndRow& row : experiment::end_rows) {
      if (row.key.empty()) continue;
      made.fields.push_back({.facts = {.key = row.key, .unit = row.unit, .meaning = row.meaning, .range = row.range},
                             .shape = row.takes_value() ? Shape::number : Shape::flag_true});
    }
    made.fields.push_back(field_of<When>(
        {.key = "when", .meaning = "the condition is left out unless this holds for the configuration"}));
    const auto list = [&made](std::string_view key, std::string_view what) {
      made.fields.push_back({{.key = key, .meaning = what}, Shape::tables, &grammar_of<ConditionScript>});
    };
    list("any", "the first of these that holds");
    list("all", "all of these at the same time");
    return made;
  }();
  return grammar;
}

void TableReader::read(const Entry& entry, std::vector<ConditionScript>& conditions) const {
  const TableReader reader(source_, table(entry), grammar_of<ConditionScript>(), entry.place);
  if (const Entry* any = reader.find("any"); any != nullptr && reader.entries().size() == 1) {
    conditions = read_list(reader, *any, Depth::any);
  } else {
    conditions = {read_condition(reader, Depth::until)};
  }
}

void TableReader::read(const Entry& entry, When& when) const {
  const auto all = get<std::string>(entry);
  // Two-character operations first: "<" is the beginning of "<=".
  for (const std::string_view operation : {"!=", "<=", ">=", "=", "<", ">"}) {
    const std::size_t found = all.find(operation);
    if (found == std::string::npos) continue;
    const std::string_view view = all;
    when = {std::string(rig::trimmed(view.substr(0, found))), std::string(operation),
            std::string(rig::trimmed(view.substr(found + operation.size()))), entry.place};
    const Key& key = source_.key(when.key, entry.place);
    source_.check_value(when.key, parse_value(key, when.value), entry.place);
    const bool ordered =
        !std::holds_alternative<std::string*>(key.target) && !std::holds_alternative<bool*>(key.target);
    if (!ordered && operation != "=" && operation != "!=") {
      fail(entry.place, fmt::format("when = \"{}\": {} is no number; compare it with = or !=", all, when.key));
    }
    return;
  }
  fail(entry.place, fmt::format("when = \"{}\": give a comparison, \"KEY = VALUE\", with one of = != < > <= >=", all));
}

}  // namespace abs_hil::config

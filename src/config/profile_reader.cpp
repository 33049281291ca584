// Profiles of an experiment's file: a constant, a ramp, a step, points or a CSV file, over the time of the phase. Its
// conditions: `when`, over the configuration, and `until`, over the run.

#include <fmt/format.h>

#include <algorithm>
#include <array>

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

Number seconds(double value, Place place) {
  return {.value = value, .unit = "s", .range = rig::from_zero(day_s), .place = place};
}

/// The fields of a line of CSV, without quotation marks and blanks around them, and with points for decimal commas.
std::vector<std::string> csv_fields(std::string_view line, char separator) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;
    } else if (c == separator && !quoted) {
      fields.emplace_back();
    } else {
      fields.back() += c == ',' ? '.' : c;
    }
  }
  for (std::string& field : fields) field = rig::trimmed(field);
  return fields;
}

/// Reads the profile of `outer`, whose row gives the values their unit and their range.
class ProfileReader {
 public:
  ProfileReader(const TableReader& phase, const Entry& outer)
      : facts_(outer.field->facts),
        outer_(outer),
        reader_(phase.source(), *outer.node->as_table(), grammar_of<ProfileForm>(), outer.place) {
    profile_.place = reader_.place();
  }

  ProfileScript read() {
    only_one_form();
    if (has("from") || has("to") || has("over")) {
      const Number from = value("from", "a ramp");
      const Number to = value("to", "a ramp");
      profile_.points = {{seconds(0.0, from.place), from}, {reader_.get<Number>(need("over", "a ramp")), to}};
    } else if (has("before") || has("after") || has("at")) {
      const Number before = value("before", "a step");
      const Number after = value("after", "a step");
      const Number at = reader_.get<Number>(need("at", "a step"));
      profile_.points = {{seconds(0.0, before.place), before}, {at, before}, {at, after}};
    } else if (const Entry* points = reader_.find("points")) {
      read_points(*points);
    } else {
      read_file(need("file", "a profile"));
    }
    if (const Entry* between = reader_.find("between")) {
      if (!has("points") && !has("file")) {
        reader_.fail(between->key_place, "between applies to points or a file only; leave it out");
      }
      reader_.read(*between, profile_.between);
    }
    return profile_;
  }

 private:
  [[nodiscard]] bool has(std::string_view name) const { return reader_.find(name) != nullptr; }

  [[nodiscard]] const Entry& need(std::string_view name, std::string_view form) const {
    const Entry* entry = reader_.find(name);
    if (entry == nullptr) {
      reader_.fail(
          reader_.place(),
          fmt::format("{}: {} has no \"{}\"; give a ramp {{ from, to, over_s }}, a step {{ before, after, at_s }}, "
                      "points or a file",
                      outer_.key, form, name));
    }
    return *entry;
  }

  [[nodiscard]] Number value(std::string_view name, std::string_view form) const {
    return value_of(*need(name, form).node, name);
  }

  /// A value of the profile. The key above may give the unit (`torque_Nm = {...}`), or each number does.
  [[nodiscard]] Number value_of(const toml::node& node, std::string_view what) const {
    const Place place = place_of(node.source());
    if (!facts_.unit.empty() && node.is_number() && !outer_.has_suffix) {
      reader_.fail(place, fmt::format("{} = {} has no unit; name it in the key {}{} = ... or write \"{} {}\"", what,
                                      shown(node), facts_.key, suffix_of(facts_.unit), shown(node), facts_.unit));
    }
    if (outer_.has_suffix && node.is_string() && !node.as_string()->get().starts_with('$')) {
      reader_.fail(place, fmt::format("{} = {}: the key {} names the unit already; write a plain number", what,
                                      shown(node), outer_.key));
    }
    rig::OptionFacts inner = facts_;
    inner.key = what;
    return read_number(reader_.source(), node, inner, what, outer_.has_suffix);
  }

  void only_one_form() const {
    const auto form_of = [](std::string_view key) {
      constexpr std::array<std::string_view, 8> keys{"from", "to", "over", "before", "after", "at", "points", "file"};
      constexpr std::array<int, 8> forms{1, 1, 1, 2, 2, 2, 3, 4};
      const auto at = std::ranges::find(keys, key);
      return at == keys.end() ? 0 : forms.at(static_cast<std::size_t>(at - keys.begin()));
    };
    const Entry* first = nullptr;
    for (const Entry& entry : reader_.entries()) {
      const int form = form_of(entry.field->facts.key);
      if (form == 0) continue;
      if (first != nullptr && form_of(first->field->facts.key) != form) {
        reader_.fail(entry.key_place,
                     fmt::format("{}: \"{}\" and \"{}\" contradict each other; give a ramp, a step, points or a file",
                                 outer_.key, first->field->facts.key, entry.field->facts.key));
      }
      first = &entry;
    }
  }

  void add_point(double time_s, const Number& value, Place place) {
    if (!(time_s >= 0.0 && time_s <= day_s)) {
      reader_.fail(place,
                   fmt::format("{}: time {} s of a point is not valid; give one in [0, 86400] s", outer_.key, time_s));
    }
    if (!profile_.points.empty() && time_s < profile_.points.back().first.value) {
      reader_.fail(place, fmt::format("{}: time {} s comes after {} s; give the points in the order of time",
                                      outer_.key, time_s, profile_.points.back().first.value));
    }
    profile_.points.emplace_back(seconds(time_s, place), value);
  }

  void read_points(const Entry& entry) {
    const auto* list = entry.node->as_array();
    if (list == nullptr || list->empty()) {
      reader_.fail(entry.place, fmt::format("points = {}: give [[time in s, value], ...]", shown(*entry.node)));
    }
    for (const toml::node& node : *list) {
      const Place place = place_of(node.source());
      const auto* pair = node.as_array();
      const bool whole = pair != nullptr && pair->size() == 2 && pair->get(0)->is_number();
      const auto time_s = whole ? pair->get(0)->value<double>() : std::nullopt;
      if (!time_s) reader_.fail(place, fmt::format("points holds {}: give [time in s, value]", shown(node)));
      add_point(*time_s, value_of(*pair->get(1), "a point"), place);
    }
  }

  void read_file(const Entry& entry) {
    const auto name = reader_.get<std::string>(entry);
    if (name.empty() || name.find('/') != std::string::npos || !name.ends_with(".csv")) {
      reader_.fail(entry.place,
                   fmt::format("file = \"{}\": name a .csv file beside the script, without a folder", name));
    }
    if (!facts_.unit.empty() && !outer_.has_suffix) {
      reader_.fail(entry.place, fmt::format("file = \"{}\": its values have no unit; name it in the key {}{} = ...",
                                            name, facts_.key, suffix_of(facts_.unit)));
    }
    const std::optional<std::string> text = reader_.source().named_file(name);
    if (!text) reader_.fail(entry.place, fmt::format("file = \"{}\": there is no such file beside the script", name));
    read_rows(name, *text, entry.place);
  }

  /// CSV as a person writes it or a spreadsheet saves it: with a byte order mark, line ends of Windows, fields in
  /// quotes,
  /// ';' or tabs beside decimal commas. Empty rows and lines that begin with '#' are left out.
  void read_rows(const std::string& name, std::string_view text, Place place) {
    constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
    if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
    if (!rig::is_utf8(text)) {
      reader_.fail(place, fmt::format("file \"{}\" is not UTF-8 text; save it as CSV in UTF-8", name));
    }
    char separator = 0;
    std::size_t time_column = 0, value_column = 0;
    for (std::size_t row = 1; !text.empty(); ++row) {
      const std::string_view line = text.substr(0, text.find_first_of("\r\n"));
      text.remove_prefix(line.size());
      text.remove_prefix(std::min<std::size_t>(text.starts_with("\r\n") ? 2 : 1, text.size()));
      if (line.starts_with('#') || line.find_first_not_of(" \t,;") == line.npos) continue;
      const bool header = separator == 0;
      if (header) separator = line.find('\t') != line.npos ? '\t' : line.find(';') != line.npos ? ';' : ',';
      const std::vector<std::string> fields = csv_fields(line, separator);
      const auto number = [&fields](std::size_t n) {
        return n < fields.size() ? rig::parse_number<double>(fields[n]) : std::nullopt;
      };
      if (header) {
        time_column = static_cast<std::size_t>(std::ranges::find(fields, "time_s") - fields.begin());
        value_column = static_cast<std::size_t>(std::ranges::find(fields, "value") - fields.begin());
        if (std::max(time_column, value_column) < fields.size()) continue;
        reader_.fail(place, fmt::format("file \"{}\": the first line is wrong; give time_s,value", name));
      }
      const auto time_s = number(time_column), value = number(value_column);
      if (!time_s || !value || !facts_.range.contains(*value)) {
        reader_.fail(place, fmt::format("file \"{}\", line {}: give a time in s and a value in {}", name, row,
                                        facts_.range.text()));
      }
      add_point(*time_s, {.value = *value, .unit = facts_.unit, .range = facts_.range, .place = place}, place);
    }
    if (profile_.points.empty())
      reader_.fail(place, fmt::format("file \"{}\" holds no points; give at least one", name));
  }

  const rig::OptionFacts& facts_;
  const Entry& outer_;
  TableReader reader_;
  ProfileScript profile_{};
};

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

void TableReader::read(const Entry& entry, ProfileScript& profile) const {
  if (entry.node->is_table()) {
    profile = ProfileReader(*this, entry).read();
    return;
  }
  const rig::OptionFacts& facts = entry.field->facts;
  const auto* text = entry.node->as_string();
  if (text != nullptr && !facts.allowed.empty() && !text->get().starts_with('$') &&
      !parse_quantity(text->get(), facts.unit)) {
    fail(entry.place, fmt::format("{} = {}: give \"{}\", a number in {}, or a profile {{ from, to, over_s }}, {{ "
                                  "before, after, at_s }}, {{ points }}, {{ file }} ({})",
                                  entry.key, shown(*entry.node), fmt::join(facts.allowed.list(), "\", \""),
                                  facts.range.text(), facts.meaning));
  }
  profile = {.points = {{seconds(0.0, entry.place), get<Number>(entry)}}, .place = entry.place};
}

}  // namespace abs_hil::config

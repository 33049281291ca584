#include <fmt/format.h>

#include "config/reader.hpp"

namespace abs_hil::config {

namespace {

using experiment::EndKind;

struct Known {
  std::string_view name;
  EndKind kind;
};
constexpr std::array<Known, 12> conditions{{
    {"lasts", EndKind::duration},
    {"upper_speed_above", EndKind::upper_speed_above},
    {"upper_speed_below", EndKind::upper_speed_below},
    {"upper_wheel_peak", EndKind::upper_wheel_peak},
    {"lower_speed_above", EndKind::lower_speed_above},
    {"lower_speed_below", EndKind::lower_speed_below},
    {"car_speed_above", EndKind::car_speed_above},
    {"car_speed_below", EndKind::car_speed_below},
    {"slip_above", EndKind::slip_above},
    {"slip_below", EndKind::slip_below},
    {"distance", EndKind::distance},
    {"standstill", EndKind::standstill},
}};

/// `until` may hold a list any or all. A list any may hold lists all. Deeper lists are refused.
enum class Depth { until, any, all };

std::vector<ConditionScript> read_list(const Source& source, const TableReader& reader, const Entry& entry,
                                       Depth depth);

ConditionScript read_condition(const Source& source, const TableReader& reader, Depth depth) {
  ConditionScript condition;
  condition.when = reader.optional_when();
  condition.place = reader.place();
  const Entry* what = nullptr;
  for (const Entry& entry : reader.entries()) {
    if (entry.field->facts.key == "when") continue;
    if (what != nullptr) {
      source.fail(entry.key_place,
                  fmt::format("\"{}\" and \"{}\" in one condition; give any = [{{ ... }}, {{ ... }}] or all = "
                              "[{{ ... }}, {{ ... }}]",
                              what->key, entry.key));
    }
    what = &entry;
  }
  if (what == nullptr) {
    source.fail(reader.place(),
                "an end condition is missing; give lasts_s, upper_speed_above_rad_s, car_speed_below_m_s, "
                "standstill, ... (docs/experiments.md)");
  }
  if (what->field->facts.key == "all" && depth != Depth::all) {
    condition.kind = EndKind::all;
    condition.parts = read_list(source, reader, *what, Depth::all);
    for (const ConditionScript& part : condition.parts) {
      // Without this condition the others would mean something else. The parser does not guess.
      if (part.when) source.fail(part.place, "a condition within all takes no when; give the when to the list");
    }
    return condition;
  }
  if (what->field->facts.key == "any" || what->field->facts.key == "all") {
    source.fail(what->key_place,
                fmt::format("\"{}\" must not stand in this list; only any may hold a list, and only all", what->key));
  }
  for (const Known& known : conditions) {
    if (known.name == what->field->facts.key) condition.kind = known.kind;
  }
  if (condition.kind == EndKind::standstill) {
    const auto* flag = what->node->as_boolean();
    if (flag == nullptr || !flag->get()) {
      source.fail(what->place, fmt::format("standstill = {}: write true", shown(*what->node)));
    }
  } else {
    condition.value = reader.number(*what);
  }
  return condition;
}

std::vector<ConditionScript> read_list(const Source& source, const TableReader& reader, const Entry& entry,
                                       Depth depth) {
  std::vector<ConditionScript> list;
  for (const toml::table* table : reader.tables(entry)) {
    list.push_back(read_condition(source, TableReader(source, *table, until_grammar(), entry.place), depth));
  }
  return list;
}

}  // namespace

std::vector<ConditionScript> read_until(const Source& source, const toml::table& table, Place place) {
  const TableReader reader(source, table, until_grammar(), place);
  if (const Entry* any = reader.find("any"); any != nullptr && reader.entries().size() == 1) {
    return read_list(source, reader, *any, Depth::any);
  }
  return {read_condition(source, reader, Depth::until)};
}

}  // namespace abs_hil::config

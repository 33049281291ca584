#include <fmt/format.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "abs_hil/rig/quantities.hpp"
#include "abs_hil/rig/reason.hpp"
#include "program/exit_status.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

using Json = nlohmann::ordered_json;  // keeps the order of insertion

void print(const Json& rows) { fmt::print("{}\n", rows.dump(1)); }

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

}  // namespace

int list_quantities(bool json) {
  const Json rows = quantities();
  if (json) {
    print(rows);
    return exit_completed;
  }
  fmt::print("{:<24}  {:<15}  {:>3}  {}\n", "quantity", "unit", "CSV", "meaning");
  for (const Json& row : rows) {
    fmt::print("{:<24}  {:<15}  {:>3}  {}\n", row["name"].get<std::string>(), row["unit"].get<std::string>(),
               row["csv_column"].is_null() ? "" : row["csv_column"].dump(), row["meaning"].get<std::string>());
  }
  return exit_completed;
}

int list_reasons(bool json) {
  if (json) {
    print(reasons());
    return exit_completed;
  }
  fmt::print("{:>6}  {:<12}  {:<32}  {}\n", "number", "kind", "found again by replay", "reason");
  for (const rig::ReasonRow& row : rig::reasons) {
    fmt::print("{:>6}  {:<12}  {:<32}  {}\n", static_cast<std::uint16_t>(row.reason), rig::name_of(row.kind),
               rig::name_of(row.found_again), row.text);
  }
  return exit_completed;
}

}  // namespace abs_hil::program

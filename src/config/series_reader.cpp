#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/reader.hpp"

namespace abs_hil::config {

namespace {

constexpr std::size_t most_runs = 100'000;
/// Keys that a script must not set: they describe the computer and its user, not the experiment.
constexpr std::array<std::string_view, 7> not_for_scripts{"driver.", "realtime.", "guardian.",      "commands.",
                                                          "rig.",    "unsafe.",   "experiment.name"};

void refuse_foreign(const Source& source, std::string_view key, Place place) {
  if (!script_may_set(key)) source.fail(place, fmt::format("a script must not set {}; use --config or --set", key));
}

std::string dotted(const std::string& prefix, std::string_view name) {
  return prefix.empty() ? std::string(name) : fmt::format("{}.{}", prefix, name);
}

config::Value value_of(const Source& source, std::string_view key, const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* flag = node.as_boolean()) return flag->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* real = node.as_floating_point()) return real->get();
  source.fail(place_of(node.source()),
              fmt::format("{} = {} is neither a number, a flag nor a text; give one of them", key, shown(node)));
}

void add_settings(const Source& source, const toml::table& table, const std::string& prefix,
                  std::vector<Setting>& settings) {
  for (const auto& [name, node] : table) {
    const std::string key = dotted(prefix, name.str());
    if (const auto* inner = node.as_table()) {
      add_settings(source, *inner, key, settings);
      continue;
    }
    const Place place = place_of(name.source());
    static_cast<void>(source.key(key, place));
    refuse_foreign(source, key, place);
    config::Value value = value_of(source, key, node);
    Setting setting{key, std::move(value), place_of(node.source())};
    source.check_value(key, setting.value, setting.place);
    settings.push_back(std::move(setting));
  }
}

Varied read_steps(const Source& source, const std::string& key, const toml::table& table, Place place) {
  const TableReader reader(source, table, steps_grammar(), place);
  const Number from = reader.number(*reader.find("from"));
  const Number to = reader.number(*reader.find("to"));
  const std::int64_t steps = reader.whole(*reader.find("steps"));
  if (!from.key.empty() || !to.key.empty()) {
    source.fail(reader.place(), fmt::format("{}: give numbers, not $keys", key));
  }
  Varied varied{key, {}, reader.place()};
  for (std::int64_t i = 0; i < steps; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(steps - 1);
    varied.values.emplace_back(std::lerp(from.value, to.value, part));
  }
  return varied;
}

/// True if the table is a range of values. Otherwise it is a part of a longer key.
bool is_steps(const toml::table& table) { return table.contains("steps") || table.contains("from"); }

void add_varied(const Source& source, const toml::table& table, const std::string& prefix, std::vector<Varied>& vary) {
  for (const auto& [name, node] : table) {
    const std::string key = dotted(prefix, name.str());
    const Place place = place_of(node.source());
    const auto* inner = node.as_table();
    if (inner != nullptr && !is_steps(*inner)) {
      add_varied(source, *inner, key, vary);
      continue;
    }
    static_cast<void>(source.key(key, place_of(name.source())));
    refuse_foreign(source, key, place_of(name.source()));
    if (key == "run.seed") source.fail(place, "[vary] takes no run.seed; give repeat or seeds in [series]");
    Varied varied{key, {}, place};
    if (inner != nullptr) {
      varied = read_steps(source, key, *inner, place);
    } else if (const auto* list = node.as_array()) {
      for (const toml::node& value : *list) varied.values.push_back(value_of(source, key, value));
    }
    if (varied.values.empty()) {
      source.fail(place, fmt::format("{} = {}: give a list of values or {{ from, to, steps }}", key, shown(node)));
    }
    for (const config::Value& value : varied.values) source.check_value(key, value, place);
    vary.push_back(std::move(varied));
  }
}

}  // namespace

bool script_may_set(std::string_view key) noexcept {
  return std::ranges::none_of(not_for_scripts, [key](std::string_view start) { return key.starts_with(start); });
}

std::vector<Setting> read_settings(const Source& source, const TableReader& root) {
  std::vector<Setting> settings;
  if (const Entry* entry = root.find("settings")) add_settings(source, root.table(*entry), {}, settings);
  return settings;
}

SeriesScript read_series(const Source& source, const TableReader& root) {
  SeriesScript series;
  if (const Entry* entry = root.find("series")) {
    series.given = true;
    const TableReader reader(source, root.table(*entry), series_grammar(), entry->place);
    if (const Entry* experiments = reader.find("experiments")) {
      Varied names{"experiment.name", {}, experiments->place};
      for (std::string& name : reader.texts(*experiments)) names.values.emplace_back(std::move(name));
      series.vary.push_back(std::move(names));
      series.of_experiments = true;
    }
    if (const Entry* repeat = reader.find("repeat")) series.repeat = reader.whole(*repeat);
    if (const Entry* seed = reader.find("seed")) series.seed = reader.whole(*seed);
    if (const Entry* seeds = reader.find("seeds")) {
      if (reader.find("repeat") != nullptr || reader.find("seed") != nullptr) {
        source.fail(seeds->key_place, "seeds replaces repeat and seed; leave one or the other out");
      }
      series.seeds = reader.wholes(*seeds);
    }
    if (const auto pause = reader.optional_number("pause")) {
      if (!pause->key.empty()) source.fail(pause->place, "pause: give a number, not a $key");
      series.pause_s = pause->value;
    }
  }
  if (const Entry* entry = root.find("vary")) {
    series.given = true;
    add_varied(source, root.table(*entry), {}, series.vary);
    // The runs are numbered in the order of the file. toml++ does not keep it.
    const std::ptrdiff_t experiments = series.of_experiments ? 1 : 0;  // they come first, wherever they stand
    std::sort(series.vary.begin() + experiments, series.vary.end(), [](const Varied& a, const Varied& b) {
      return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
    });
  }
  double runs = series.seeds.empty() ? static_cast<double>(series.repeat) : static_cast<double>(series.seeds.size());
  for (const Varied& varied : series.vary) runs *= static_cast<double>(varied.values.size());
  if (runs > static_cast<double>(most_runs)) {
    source.fail(root.place(), fmt::format("the series has {:.0f} runs; give at most {}", runs, most_runs));
  }
  return series;
}

}  // namespace abs_hil::config

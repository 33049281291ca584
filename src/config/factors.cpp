// Configuration values in files: the tables [settings] and [factors].
//
// A factor's value at the probability u is F^-1(u): from + u (to - from) for a uniform range, from (to / from)^u for a
// logarithmic one, and for a normal range cut off at least and most the quantile of the normal distribution at
// F(least) + u (F(most) - F(least)).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "config/reader.hpp"

namespace abs_hil::config {

namespace {

/// Keys that a script must not set: they describe the computer and its user, not the experiment.
constexpr std::array<std::string_view, 7> not_for_scripts{"driver.", "realtime.", "guardian.",      "commands.",
                                                          "rig.",    "unsafe.",   "experiment.name"};
/// Keys of a table that is a range of values. Any other table is a part of a longer key.
constexpr std::array<std::string_view, 5> range_keys{"from", "to", "steps", "mean", "sd"};

bool is_range(const toml::table& table) {
  return std::ranges::any_of(range_keys, [&table](std::string_view key) { return table.contains(key); });
}

/// A range as a file gives it.
struct RangeForm {
  ABS_HIL_OPTIONS(RangeForm);
  static constexpr std::string_view title = "a range of values";
  static constexpr std::string_view meaning = "Equally spaced values with steps, a uniform or a normal range without";
  ABS_HIL_OPTION(std::optional<double>, from, {}, .meaning = "one end", .range = any_number);
  ABS_HIL_OPTION(std::optional<double>, to, {}, .meaning = "the other end", .range = any_number);
  ABS_HIL_OPTION(std::int64_t, steps, 0, .meaning = "how many values", .range = rig::between(2, 1e6));
  ABS_HIL_OPTION(std::string, scale, "linear", .meaning = "what is uniform: the value or its logarithm",
                 .allowed = {"linear", "log"});
  ABS_HIL_OPTION(std::optional<double>, mean, {}, .meaning = "mean of a normal range", .range = any_number);
  ABS_HIL_OPTION(std::optional<double>, sd, {}, .meaning = "standard deviation of a normal range",
                 .range = rig::positive(1e15));
  ABS_HIL_OPTION(std::optional<double>, least, {}, .meaning = "where a normal range is cut off", .range = any_number);
  ABS_HIL_OPTION(std::optional<double>, most, {}, .meaning = "where a normal range is cut off", .range = any_number);
  Place place{};

  [[nodiscard]] bool normal() const noexcept { return mean || sd; }
  void check(const TableReader& reader) const {
    for (const Entry& entry : reader.entries()) {
      const bool of_uniform = entry.key == "from" || entry.key == "to" || entry.key == "steps" || entry.key == "scale";
      if (normal() && of_uniform) {
        reader.fail(entry.key_place,
                    fmt::format("a normal range has mean, sd, least and most; leave {} out", entry.key));
      }
      if (!normal() && !of_uniform) {
        reader.fail(entry.key_place, fmt::format("{} belongs to a normal range; give from and to", entry.key));
      }
    }
  }
};

[[noreturn]] void refuse_range(const Source& source, const Key& key, const RangeForm& form, std::string_view why) {
  source.fail(form.place, fmt::format("{}: {}", key.name, why));
}

double end_of(const Source& source, const Key& key, const RangeForm& form, const std::optional<double>& value,
              std::string_view name) {
  if (!value) {
    refuse_range(
        source, key, form,
        fmt::format("the range has no {}; give {{ from, to }}, {{ from, to, steps }} or {{ mean, sd }}", name));
  }
  return *value;
}

Uniform uniform_of(const Source& source, const Key& key, const RangeForm& form) {
  const Uniform range{end_of(source, key, form, form.from, "from"), end_of(source, key, form, form.to, "to"),
                      form.scale == "log"};
  if (range.from == range.to) {
    refuse_range(source, key, form, fmt::format("both ends are {}; give two ends or a list", range.to));
  }
  if (range.logarithmic && !(range.from > 0.0 && range.to > 0.0)) {
    refuse_range(source, key, form,
                 fmt::format("a logarithmic range needs ends above 0; it has {} and {}", range.from, range.to));
  }
  for (const double value : {range.from, range.to}) source.check_value(key.name, value, form.place);
  return range;
}

Levels steps_of(const Source& source, const Key& key, const RangeForm& form) {
  const Uniform range = uniform_of(source, key, form);
  Levels levels;
  for (std::int64_t i = 0; i < form.steps; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(form.steps - 1);
    levels.values.emplace_back(i + 1 == form.steps ? range.to : at(range, part));
    source.check_value(key.name, levels.values.back(), form.place);
  }
  return levels;
}

Normal normal_of(const Source& source, const Key& key, const RangeForm& form) {
  // Without ends of its own, the range ends where the key's does. An open end is not reached.
  const auto inside = [](double value, double other, bool open) { return open ? std::nextafter(value, other) : value; };
  const rig::Range& valid = key.range;
  const Normal normal{.mean = end_of(source, key, form, form.mean, "mean"),
                      .sd = end_of(source, key, form, form.sd, "sd"),
                      .least = form.least.value_or(inside(valid.least, valid.most, valid.least_open)),
                      .most = form.most.value_or(inside(valid.most, valid.least, valid.most_open))};
  for (const double value : {normal.least, normal.most}) source.check_value(key.name, value, form.place);
  constexpr double far = 6.0;  // beyond it the part that remains has next to no probability
  if (!(normal.least < normal.most) || normal.mean + far * normal.sd < normal.least ||
      normal.mean - far * normal.sd > normal.most) {
    refuse_range(
        source, key, form,
        fmt::format("nothing of the normal range lies in [{}, {}]; give a mean nearer to it, or least below most",
                    normal.least, normal.most));
  }
  return normal;
}

/// The values of one factor, from its range.
std::variant<Levels, Uniform, Normal> values_of(const Source& source, const Key& key, const RangeForm& form) {
  if (form.steps > 0) return steps_of(source, key, form);
  if (!std::holds_alternative<double*>(key.target)) {
    refuse_range(source, key, form, "only a real number has a range; give a list of values");
  }
  if (form.normal()) return normal_of(source, key, form);
  return uniform_of(source, key, form);
}

Value read_value(const Source& source, std::string_view key, const toml::node& node) {
  if (std::optional<Value> value = value_in(node)) return std::move(*value);
  source.fail(place_of(node.source()),
              fmt::format("{} = {} is neither a number, a flag nor a text; give one of them", key, shown(node)));
}

Levels read_levels(const Source& source, const std::string& key, const toml::node& node) {
  Levels levels;
  if (const auto* list = node.as_array()) {
    for (const toml::node& value : *list) {
      levels.values.push_back(read_value(source, key, value));
      source.check_value(key, levels.values.back(), place_of(value.source()));
    }
  }
  if (levels.values.empty()) {
    source.fail(place_of(node.source()),
                fmt::format("{} = {}: give a list of values, {{ from, to }}, {{ from, to, steps }} or {{ mean, sd }}",
                            key, shown(node)));
  }
  return levels;
}

}  // namespace

bool script_may_set(std::string_view key) noexcept {
  return std::ranges::none_of(not_for_scripts, [key](std::string_view start) { return key.starts_with(start); });
}

double at(const Uniform& range, double u) noexcept {
  const double value =
      range.logarithmic ? range.from * std::pow(range.to / range.from, u) : std::lerp(range.from, range.to, u);
  return std::clamp(value, std::min(range.from, range.to), std::max(range.from, range.to));
}

void TableReader::read(const Entry& entry, std::vector<Setting>& settings) const {
  const auto never = [](const toml::table&) { return false; };
  for_each_value(table(entry), {}, never, [&](const std::string& key, Place place, const toml::node& node) {
    static_cast<void>(source_.key(key, place));
    if (!script_may_set(key)) {
      fail(place, fmt::format("a script must not set {}; use --config or --set", key));
    }
    settings.push_back({key, read_value(source_, key, node), place_of(node.source())});
    source_.check_value(key, settings.back().value, settings.back().place);
  });
}

void TableReader::read(const Entry& entry, std::vector<Factor>& factors) const {
  for_each_value(table(entry), {}, is_range, [&](const std::string& name, Place place, const toml::node& node) {
    const Key& key = source_.key(name, place);
    Factor factor{.key = name, .place = place};
    if (const auto* range = node.as_table()) {
      RangeForm form;
      read_table(source_, *range, place_of(node.source()), form);
      factor.values = values_of(source_, key, form);
    } else {
      factor.values = read_levels(source_, name, node);
    }
    factors.push_back(std::move(factor));
  });
  // The file's order numbers the runs. toml++ does not keep it.
  std::ranges::sort(factors, {},
                    [](const Factor& factor) { return std::pair(factor.place.line, factor.place.column); });
}

}  // namespace abs_hil::config

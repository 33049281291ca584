// Configuration values in files: the tables [settings] and [factors].
//
// A factor's value at the probability u is F^-1(u): from + u (to - from) for a uniform range, from (to / from)^u for a
// logarithmic one, and for a normal range cut off at least and most the quantile of the normal distribution at
// F(least) + u (F(most) - F(least)).
#include "config/factors.hpp"

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

/// The values of one factor, from its range.
class RangeValues {
 public:
  RangeValues(const Source& source, const Key& key, const RangeForm& form) : source_(source), key_(key), form_(form) {}

  [[nodiscard]] std::variant<Levels, Uniform, Normal> values() const {
    if (form_.steps > 0) return steps();
    if (!std::holds_alternative<double*>(key_.target)) fail("only a real number has a range; give a list of values");
    if (form_.normal()) return normal();
    return uniform();
  }

 private:
  [[noreturn]] void fail(std::string_view why) const {
    source_.fail(form_.place, fmt::format("{}: {}", key_.name, why));
  }

  [[nodiscard]] double end(const std::optional<double>& value, std::string_view name) const {
    if (!value) {
      fail(fmt::format("the range has no {}; give {{ from, to }}, {{ from, to, steps }} or {{ mean, sd }}", name));
    }
    return *value;
  }

  [[nodiscard]] Uniform uniform() const {
    const Uniform range{end(form_.from, "from"), end(form_.to, "to"), form_.scale == "log"};
    if (range.from == range.to) fail(fmt::format("both ends are {}; give two ends or a list", range.to));
    if (range.logarithmic && !(range.from > 0.0 && range.to > 0.0)) {
      fail(fmt::format("a logarithmic range needs ends above 0; it has {} and {}", range.from, range.to));
    }
    for (const double value : {range.from, range.to}) source_.check_value(key_.name, value, form_.place);
    return range;
  }

  [[nodiscard]] Levels steps() const {
    const Uniform range = uniform();
    Levels levels;
    for (std::int64_t i = 0; i < form_.steps; ++i) {
      const double part = static_cast<double>(i) / static_cast<double>(form_.steps - 1);
      levels.values.emplace_back(i + 1 == form_.steps ? range.to : at(range, part));
      source_.check_value(key_.name, levels.values.back(), form_.place);
    }
    return levels;
  }

  [[nodiscard]] Normal normal() const {
    // Without ends of its own, the range ends where the key's does. An open end is not reached.
    const auto inside = [](double value, double other, bool open) {
      return open ? std::nextafter(value, other) : value;
    };
    const rig::Range& valid = key_.range;
    const Normal normal{.mean = end(form_.mean, "mean"),
                        .sd = end(form_.sd, "sd"),
                        .least = form_.least.value_or(inside(valid.least, valid.most, valid.least_open)),
                        .most = form_.most.value_or(inside(valid.most, valid.least, valid.most_open))};
    for (const double value : {normal.least, normal.most}) source_.check_value(key_.name, value, form_.place);
    constexpr double far = 6.0;  // beyond it the part that remains has next to no probability
    if (!(normal.least < normal.most) || normal.mean + far * normal.sd < normal.least ||
        normal.mean - far * normal.sd > normal.most) {
      fail(fmt::format("nothing of the normal range lies in [{}, {}]; give a mean nearer to it, or least below most",
                       normal.least, normal.most));
    }
    return normal;
  }

  const Source& source_;
  const Key& key_;
  const RangeForm& form_;
};

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

/// Calls `visit(dotted name, place of the name, node)` for each value below a table of configuration keys. A table
/// for which `is_value` is true is a value.
template <class IsValue, class Visit>
void for_each_value(const toml::table& table, const std::string& prefix, const IsValue& is_value, const Visit& visit) {
  for (const auto& [name, node] : table) {
    const std::string key = prefix.empty() ? std::string(name.str()) : fmt::format("{}.{}", prefix, name.str());
    const auto* inner = node.as_table();
    if (inner != nullptr && !is_value(*inner)) {
      for_each_value(*inner, key, is_value, visit);
    } else {
      visit(key, place_of(name.source()), node);
    }
  }
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

Value read_value(const Source& source, std::string_view key, const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* flag = node.as_boolean()) return flag->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* real = node.as_floating_point()) return real->get();
  source.fail(place_of(node.source()),
              fmt::format("{} = {} is neither a number, a flag nor a text; give one of them", key, shown(node)));
}

std::vector<Setting> TableReader::settings(const Entry& entry) const {
  std::vector<Setting> settings;
  const auto never = [](const toml::table&) { return false; };
  for_each_value(table(entry), {}, never, [&](const std::string& key, Place place, const toml::node& node) {
    static_cast<void>(source_.key(key, place));
    if (!script_may_set(key)) {
      fail(place, fmt::format("a script must not set {}; use --config or --set", key));
    }
    settings.push_back({key, read_value(source_, key, node), place_of(node.source())});
    source_.check_value(key, settings.back().value, settings.back().place);
  });
  return settings;
}

std::vector<Factor> TableReader::factors(const Entry& entry) const {
  std::vector<Factor> factors;
  for_each_value(table(entry), {}, is_range, [&](const std::string& name, Place place, const toml::node& node) {
    const Key& key = source_.key(name, place);
    Factor factor{.key = name, .place = place};
    if (const auto* range = node.as_table()) {
      RangeForm form;
      read_table(source_, *range, place_of(node.source()), form);
      factor.values = RangeValues(source_, key, form).values();
    } else {
      factor.values = read_levels(source_, name, node);
    }
    factors.push_back(std::move(factor));
  });
  // The file's order numbers the runs. toml++ does not keep it.
  std::ranges::sort(factors, {},
                    [](const Factor& factor) { return std::pair(factor.place.line, factor.place.column); });
  return factors;
}

}  // namespace abs_hil::config

#include "study/factor_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "study/study_grammar.hpp"

namespace abs_hil::study {

namespace {

using config::Entry;
using config::Place;
using config::place_of;
using config::Source;
using config::TableReader;

constexpr std::array<std::string_view, 5> factor_tables{"plant.", "model.", "control.", "experiment.", "gate."};
/// They choose what a run is, which the study's own keys do.
constexpr std::array<std::string_view, 3> not_factors{"experiment.name", "control.controller",
                                                      "experiment.wait_for_start"};
/// Keys of a table that is a range of values. Any other table is a part of a longer key.
constexpr std::array<std::string_view, 5> range_keys{"from", "to", "steps", "mean", "sd"};

struct Read {
  Factor factor;
  Place place;
};

bool is_range(const toml::table& table) {
  return std::ranges::any_of(range_keys, [&table](std::string_view key) { return table.contains(key); });
}

const config::Key& key_of(const Source& source, const std::string& name, Place place) {
  const config::Key& key = source.key(name, place);
  const bool may_vary =
      std::ranges::any_of(factor_tables, [&name](std::string_view table) { return name.starts_with(table); });
  if (!may_vary || std::ranges::find(not_factors, name) != not_factors.end()) {
    source.fail(place, fmt::format("{} cannot be a factor; factors are keys of plant, model, control, experiment and "
                                   "gate; plants, experiments and controllers are lists of the study",
                                   name));
  }
  return key;
}

config::Value value_of(const Source& source, std::string_view key, const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* flag = node.as_boolean()) return flag->get();
  if (const auto* integer = node.as_integer()) return integer->get();
  if (const auto* real = node.as_floating_point()) return real->get();
  source.fail(place_of(node.source()), fmt::format("{} = {} is neither a number, a flag nor a text; give one of them",
                                                   key, config::shown(node)));
}

/// Reads one range. All keys of the table have been checked by its grammar.
class RangeReader {
 public:
  RangeReader(const Source& source, const config::Key& key, const toml::table& table, Place place)
      : source_(source), key_(key), reader_(source, table, range_grammar(), place) {}

  [[nodiscard]] Factor read() const {
    Factor factor{.key = key_.name};
    const bool normal = has("mean") || has("sd");
    refuse_together(normal);
    if (normal) {
      factor.values = read_normal();
    } else if (has("steps")) {
      factor.values = read_steps();
    } else {
      factor.values = read_uniform();
    }
    if (factor.has_range() && !std::holds_alternative<double*>(key_.target)) {
      source_.fail(reader_.place(),
                   fmt::format("{}: only a real number has a range; give a list of values", key_.name));
    }
    return factor;
  }

 private:
  [[nodiscard]] bool has(std::string_view name) const { return reader_.find(name) != nullptr; }

  void refuse_together(bool normal) const {
    for (const std::string_view name : {"from", "to", "steps", "scale"}) {
      if (const Entry* entry = normal ? reader_.find(name) : nullptr) {
        source_.fail(entry->key_place,
                     fmt::format("{}: a normal range has mean, sd, least and most; leave {} out", key_.name, name));
      }
    }
    for (const std::string_view name : {"least", "most"}) {
      if (const Entry* entry = normal ? nullptr : reader_.find(name)) {
        source_.fail(entry->key_place,
                     fmt::format("{}: {} belongs to a normal range; give from and to", key_.name, name));
      }
    }
  }

  [[nodiscard]] double number(std::string_view name) const {
    const Entry* entry = reader_.find(name);
    if (entry == nullptr) {
      source_.fail(reader_.place(),
                   fmt::format("{}: the range has no {}; give {{ from, to }}, {{ from, to, steps }} or {{ mean, sd }}",
                               key_.name, name));
    }
    const config::Number number = reader_.number(*entry);
    if (!number.key.empty()) source_.fail(number.place, fmt::format("{}: give a number, not a $key", key_.name));
    return number.value;
  }

  [[nodiscard]] Uniform read_uniform() const {
    Uniform range{.from = number("from"), .to = number("to")};
    if (range.from == range.to) {
      source_.fail(reader_.place(), fmt::format("{}: both ends are {}; give two ends or a list", key_.name, range.to));
    }
    if (const Entry* scale = reader_.find("scale")) range.logarithmic = reader_.choice(*scale) == "log";
    if (range.logarithmic && !(range.from > 0.0 && range.to > 0.0)) {
      source_.fail(reader_.place(), fmt::format("{}: a logarithmic range needs ends above 0; it has {} and {}",
                                                key_.name, range.from, range.to));
    }
    for (const double end : {range.from, range.to}) source_.check_value(key_.name, end, reader_.place());
    return range;
  }

  [[nodiscard]] Levels read_steps() const {
    const Uniform range = read_uniform();
    const std::int64_t steps = reader_.whole(*reader_.find("steps"));
    const Factor between{.key = key_.name, .values = range};
    Levels levels;
    for (std::int64_t i = 0; i < steps; ++i) {
      const double part = static_cast<double>(i) / static_cast<double>(steps - 1);
      levels.values.emplace_back(i + 1 == steps ? range.to : quantile(between, part));
    }
    for (const config::Value& value : levels.values) source_.check_value(key_.name, value, reader_.place());
    return levels;
  }

  [[nodiscard]] Normal read_normal() const {
    // Without ends of its own, the range ends where the key's does. An open end is not reached.
    const auto inside = [](double end, double other, bool open) { return open ? std::nextafter(end, other) : end; };
    const rig::Range& valid = key_.range;
    Normal normal{.mean = number("mean"),
                  .sd = number("sd"),
                  .least = inside(valid.least, valid.most, valid.least_open),
                  .most = inside(valid.most, valid.least, valid.most_open)};
    if (has("least")) normal.least = number("least");
    if (has("most")) normal.most = number("most");
    for (const double end : {normal.least, normal.most}) source_.check_value(key_.name, end, reader_.place());
    constexpr double far = 6.0;  // beyond it the part that remains has next to no probability
    if (!(normal.least < normal.most) || normal.mean + far * normal.sd < normal.least ||
        normal.mean - far * normal.sd > normal.most) {
      source_.fail(reader_.place(),
                   fmt::format("{}: nothing of the normal range lies in [{}, {}]; give a mean nearer to "
                               "it, or least below most",
                               key_.name, normal.least, normal.most));
    }
    return normal;
  }

  const Source& source_;
  const config::Key& key_;
  TableReader reader_;
};

void collect(const Source& source, const toml::table& table, const std::string& prefix, std::vector<Read>& found) {
  for (const auto& [name, node] : table) {
    const std::string name_of_key = prefix.empty() ? std::string(name.str()) : fmt::format("{}.{}", prefix, name.str());
    const Place place = place_of(node.source());
    const auto* inner = node.as_table();
    if (inner != nullptr && !is_range(*inner)) {
      collect(source, *inner, name_of_key, found);
      continue;
    }
    const config::Key& key = key_of(source, name_of_key, place_of(name.source()));
    if (inner != nullptr) {
      found.push_back({RangeReader(source, key, *inner, place).read(), place});
      continue;
    }
    Levels levels;
    if (const auto* list = node.as_array()) {
      for (const toml::node& value : *list) {
        levels.values.push_back(value_of(source, key.name, value));
        source.check_value(key.name, levels.values.back(), place_of(value.source()));
      }
    }
    if (levels.values.empty()) {
      source.fail(place, fmt::format("{} = {}: give a list of values, {{ from, to }}, {{ from, to, steps }} or "
                                     "{{ mean, sd }}",
                                     key.name, config::shown(node)));
    }
    found.push_back({{.key = key.name, .values = std::move(levels)}, place});
  }
}

}  // namespace

std::vector<Factor> read_factors(const Source& source, const toml::table& table) {
  std::vector<Read> found;
  collect(source, table, {}, found);
  // toml++ does not keep the order of the file, which numbers the runs.
  std::ranges::sort(found, [](const Read& a, const Read& b) {
    return std::pair(a.place.line, a.place.column) < std::pair(b.place.line, b.place.column);
  });
  std::vector<Factor> factors;
  for (Read& read : found) factors.push_back(std::move(read.factor));
  return factors;
}

}  // namespace abs_hil::study

// The rules of a study's file that concern several keys at once. Reads LABEL=CONTROLLER{KEY=VALUE,...} over common
// settings. Reduces a signal's values to one number while the records pass.
#include "study/study_script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/quantities.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/reader.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::study {

namespace {

using config::TableReader;

constexpr std::array<std::string_view, 5> factor_tables{"plant.", "model.", "control.", "experiment.", "gate."};
/// They choose what a run is, which the study's own keys do.
constexpr std::array<std::string_view, 3> not_factors{"experiment.name", "control.controller",
                                                      "experiment.wait_for_start"};

bool may_be_factor(const std::string& key) {
  return std::ranges::find(not_factors, key) == not_factors.end() &&
         std::ranges::any_of(factor_tables, [&key](std::string_view table) { return key.starts_with(table); });
}

/// Carries out `act`; an std::invalid_argument becomes an error at the key.
template <class Act>
void refuse_at(const TableReader& reader, std::string_view key, const Act& act) try {
  act();
} catch (const std::invalid_argument& error) {
  reader.fail(reader.find(key)->place, error.what());
}

void check_design(const DesignScript& design, bool given, bool ranges, const TableReader& reader) {
  if (!given) {
    if (!ranges) return;
    reader.fail(reader.find("factors")->place,
                "the factors have ranges, and the study no [design]; give kind and points in [design], or steps in "
                "each range");
  }
  const bool is_grid = design.kind == DesignKind::grid;
  if (is_grid && (ranges || design.has_points)) {
    reader.fail(design.place,
                "a grid has no points of its own; give steps in each range of [factors] and leave points out, or "
                "another kind of design");
  }
  if (!is_grid && !ranges) {
    reader.fail(design.place,
                "no factor has a range, so the design has nothing to spread; give { from, to } or { mean, sd } in "
                "[factors], or leave [design] out");
  }
  if (!is_grid && !design.has_points) {
    reader.fail(design.place, "[design] has no \"points\" (how many points); give them");
  }
}

constexpr std::size_t columns = rig::csv_columns.size();
constexpr std::size_t nowhere = columns + rig::signal_max;

using Values = std::array<double, columns + rig::signal_max>;

constexpr std::size_t column_of(std::string_view name) {
  return static_cast<std::size_t>(std::find(rig::csv_columns.begin(), rig::csv_columns.end(), name) -
                                  rig::csv_columns.begin());
}
constexpr std::size_t time_column = column_of("time_s");
constexpr std::size_t speed_column = column_of("omega2_rad_s");
static_assert(time_column < columns && speed_column < columns);

Values values_of(const rig::CycleRecord& record, double distance_m) {
  constexpr std::int64_t no_message = 0;
  const rig::CycleParts<const rig::CycleRecord> parts{record, distance_m, no_message};
  Values values{};
  std::size_t column = 0;
  rig::for_each_quantity([&](const auto& row) {
    if (row.in_csv()) values[column++] = static_cast<double>(row.at(parts));
  });
  std::copy(record.control.signals.begin(), record.control.signals.end(), values.begin() + columns);
  return values;
}

constexpr std::string_view controller_key = "control.controller";
constexpr std::string_view file_ending = ".toml";

[[noreturn]] void refuse(std::string_view entry, std::string_view why) {
  throw std::invalid_argument(fmt::format("--controllers: {}: {}", entry, why));
}

void check_key(std::string_view entry, std::string_view key) {
  if (key == controller_key) refuse(entry, "name the controller before the braces");
  if (key.starts_with("control.") || key.starts_with("model.")) return;
  refuse(entry,
         fmt::format("{} cannot differ between controllers, which all meet the same plants and experiment; give a "
                     "key of control or model, or --set {} for all",
                     key, key));
}

/// The key's full name: as it is, with "control.", or with the controller's own section.
std::string full_name(const config::KeyTable& keys, std::string_view key, const std::string& controller) {
  for (const std::string& prefix : {std::string(), std::string("control."), control::section_of(controller)}) {
    const std::string name = prefix + std::string(key);
    if (config::find_key(keys.keys(), name) != nullptr) return name;
  }
  return std::string(key);
}

void set(Contender& contender, config::KeyTable& keys, const std::string& name, const config::Value& value,
         const std::string& origin) {
  keys.set(name, value, origin);
  contender.changes.emplace_back(name, config::text_of(value));
}

/// True if the file names the controller.
bool read_file(Contender& contender, config::KeyTable& keys, const std::string& file, const std::string& entry,
               bool may_name_controller) {
  bool named = false;
  for (const config::FileValue& value : config::read_file(file)) {
    const bool names = value.name == controller_key;
    if (!names || !may_name_controller) check_key(fmt::format("{} ({})", entry, value.origin), value.name);
    set(contender, keys, value.name, value.value, value.origin);
    named = named || names;
  }
  return named;
}

/// Reads what stands between the braces: KEY=VALUE and files, with commas between them.
void read_changes(Contender& contender, std::string_view changes, const std::string& entry) {
  config::KeyTable keys(contender.settings);
  for (const std::string_view change : rig::split(changes, ',')) {
    const std::size_t equals = change.find('=');
    if (equals == std::string_view::npos && change.ends_with(file_ending)) {
      read_file(contender, keys, std::string(change), entry, false);
      continue;
    }
    if (equals == std::string_view::npos) {
      refuse(entry, fmt::format("\"{}\": give KEY=VALUE or a TOML file, as in adaptive{{gamma=60}}", change));
    }
    const std::string name =
        full_name(keys, rig::trimmed(change.substr(0, equals)), contender.settings.control.controller);
    const std::string_view text = rig::trimmed(change.substr(equals + 1));
    const config::Key* key = config::find_key(keys.keys(), name);
    if (key != nullptr) check_key(entry, name);
    set(contender, keys, name, key == nullptr ? config::Value(std::string(text)) : config::parse_value(*key, text),
        "--controllers");
  }
}

}  // namespace

void SignalMetric::check(const TableReader& reader) {
  place = reader.find("of")->place;
  if (!rig::is_signal_name(name)) {
    reader.fail(reader.find("name")->place,
                fmt::format("name = \"{}\": give letters, digits and _, a letter first, at most 32", name));
  }
}

void DesignScript::check(const TableReader& reader) { has_points = reader.find("points") != nullptr; }

void RepeatScript::check(const TableReader& reader) {
  variation = Variation::standard();
  if (reader.find("vary") != nullptr) refuse_at(reader, "vary", [this] { variation = Variation::parse(vary); });
}

void StudyScript::check(const TableReader& reader) {
  std::vector<std::string> all;
  refuse_at(reader, "controllers", [&] {
    for (const std::string& names : controllers) {
      for (std::string& one : split_contenders(names)) all.push_back(std::move(one));
    }
  });
  controllers = std::move(all);
  for (const Factor& factor : factors) {
    if (may_be_factor(factor.key)) continue;
    reader.fail(factor.place,
                fmt::format("{} cannot be a factor; factors are keys of plant, model, control, experiment and gate; "
                            "plants, experiments and controllers are lists of the study",
                            factor.key));
  }
  check_design(design, reader.find("design") != nullptr, std::ranges::any_of(factors, &Factor::has_range), reader);
}

StudyScript parse_study(std::string text, std::string path) {
  StudyScript script;
  script.path = path;
  script.text = std::move(text);
  const config::Source source(std::move(path));
  config::read_table(source, source.parsed(script.text), {1, 1}, script);
  return script;
}

StudyScript load_study(const std::string& path) {
  std::error_code error;
  std::ifstream file(path, std::ios::binary);
  if (const int why = errno; !std::filesystem::is_regular_file(path, error) || !file) {
    throw config::ConfigError(path + ": " +
                              (file || why == ENOENT ? "no such file; give a study, a TOML file (docs/studies.md)"
                                                     : rig::refusal(why, path, rig::reading)));
  }
  return parse_study({std::istreambuf_iterator<char>(file), {}}, path);
}

SignalMetrics::SignalMetrics(const std::vector<SignalMetric>& metrics, std::span<const rig::Signal> signals,
                             double r2_m)
    : r2_m_(r2_m) {
  for (const SignalMetric& metric : metrics) {
    std::size_t column = column_of(metric.of);
    if (column == columns) {
      const auto at = std::ranges::find(signals, metric.of, &rig::Signal::name);
      column = at == signals.end() ? nowhere : columns + static_cast<std::size_t>(at - signals.begin());
    }
    running_.push_back({.metric = metric, .column = column});
  }
}

void SignalMetrics::consume(const rig::CycleRecord& record, double distance_m) {
  const Values values = values_of(record, distance_m);
  for (Running& r : running_) {
    const bool within = record.phase == r.metric.phase;
    if (within && !r.within) r.begin_s = values[time_column];
    r.within = within;
    if (!within || r.column == nowhere || std::isnan(values[r.column])) continue;
    if (values[time_column] - r.begin_s < r.metric.after_s) continue;
    if (r.metric.above_m_s > 0.0 && !(r2_m_ * values[speed_column] > r.metric.above_m_s)) continue;
    const double value = values[r.column];
    const bool first = r.count++ == 0;
    switch (r.metric.take) {
      case Reduction::max: r.value = first ? value : std::max(r.value, value); break;
      case Reduction::min: r.value = first ? value : std::min(r.value, value); break;
      case Reduction::mean: r.value += value; break;
      case Reduction::rms: r.value += value * value; break;
      case Reduction::last: r.value = value; break;
    }
  }
}

std::vector<double> SignalMetrics::values() const {
  std::vector<double> values;
  for (const Running& r : running_) {
    const auto n = static_cast<double>(r.count);
    double value = r.value;
    if (r.metric.take == Reduction::mean) value /= n;
    if (r.metric.take == Reduction::rms) value = std::sqrt(value / n);
    values.push_back(r.count == 0 ? rig::unknown : value);
  }
  return values;
}

std::vector<std::string> split_contenders(std::string_view list) {
  if (list == "all") {
    std::vector<std::string> all;
    for (const control::ControllerEntry& entry : control::controllers()) all.emplace_back(entry.name);
    return all;
  }
  std::vector<std::string> entries(1);
  bool within = false;
  for (const char c : list) {
    if (c == (within ? '{' : '}')) refuse(list, "the braces do not match");
    if (c == '{' || c == '}') within = !within;
    if (c == ',' && !within) {
      entries.emplace_back();
    } else {
      entries.back() += c;
    }
  }
  if (within) refuse(list, "the braces do not match");
  if (std::any_of(entries.begin(), entries.end(), [](const std::string& entry) { return entry.empty(); })) {
    refuse(list, "empty entry; give controllers with commas between them, or all");
  }
  return entries;
}

Contender read_contender(const std::string& text, const config::Settings& common) {
  const std::size_t brace = text.find('{');
  const std::size_t equals = text.find('=');
  const bool labelled = equals < brace && equals != std::string::npos;
  Contender contender{.name = labelled ? text.substr(0, equals) : text, .settings = common};
  std::string what = labelled ? text.substr(equals + 1) : text;
  if (contender.name.empty()) refuse(text, "the label before = is empty");
  if (what.ends_with(file_ending)) {
    if (!labelled) contender.name = std::filesystem::path(what).stem().string();
    config::KeyTable keys(contender.settings);
    if (!read_file(contender, keys, what, text, true)) {
      refuse(text,
             fmt::format("the file names no controller; set {} in it, or give CONTROLLER{{{}}}", controller_key, what));
    }
    return contender;
  }
  const std::size_t open = what.find('{');
  contender.settings.control.controller = what.substr(0, open);
  // Before the changes, whose short names depend on the controller.
  static_cast<void>(control::make_controller(contender.settings.control.controller, {common.control, common.model}));
  if (open == std::string::npos) return contender;
  if (!what.ends_with('}')) refuse(text, "nothing may follow the braces");
  read_changes(contender, std::string_view(what).substr(open + 1, what.size() - open - 2), text);
  return contender;
}

}  // namespace abs_hil::study

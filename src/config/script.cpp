// Finds and reads an experiment's file: the rules that concern several keys at once, and its events as profiles of the
// plant.
#include "config/script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>

#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/injection.hpp"
#include "config/reader.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::config {

namespace fs = std::filesystem;

namespace {

using experiment::BrakeAction;

constexpr std::size_t most_runs = 100'000;

constexpr std::array<ChangingPart, 5> parts{{
    {"friction", "friction of the road", [](Settings& s) -> std::string& { return s.plant.friction_profile; },
     &EventScript::friction},
    {"brake_torque", "torque of the brake", [](Settings& s) -> std::string& { return s.plant.drift.brake_torque; },
     &EventScript::brake_torque},
    {"motor_torque", "torque of the motor", [](Settings& s) -> std::string& { return s.plant.drift.motor_torque; },
     &EventScript::motor_torque},
    {"upper_bearing", "friction of the upper wheel's bearing",
     [](Settings& s) -> std::string& { return s.plant.drift.upper_bearing; }, &EventScript::upper_bearing},
    {"lower_bearing", "friction of the lower wheel's bearing",
     [](Settings& s) -> std::string& { return s.plant.drift.lower_bearing; }, &EventScript::lower_bearing},
}};

void check_name(const PhaseScript& phase, const TableReader& reader) {
  const bool plain = !phase.name.empty() && phase.name.size() <= rig::phase_name_max &&
                     phase.name.find_first_of("\n\r\t\",") == std::string::npos;
  if (!plain) {
    reader.fail(phase.name_place,
                fmt::format("name = {}: give a name of 1 to 40 characters without quotes, commas and line ends",
                            shown(*reader.find("name")->node)));
  }
}

/// A phase that asks a person ends by the answer, and nothing acts meanwhile.
void check_ask(PhaseScript& phase, const TableReader& reader) {
  const Entry& entry = *reader.find("ask");
  constexpr std::size_t longest = 200;
  const bool plain = !phase.ask.empty() && phase.ask.size() <= longest &&
                     std::ranges::all_of(phase.ask, [](char c) { return c >= ' ' && c <= '~'; });
  if (!plain) {
    reader.fail(entry.place, fmt::format("ask = {}: give a line of 1 to {} printable ASCII characters",
                                         shown(*entry.node), longest));
  }
  const auto refuse = [&](std::string_view key, std::string_view why) {
    reader.fail(reader.find(key)->key_place,
                fmt::format("phase \"{}\" asks a person: {}; leave {} out", phase.name, why, key));
  };
  if (reader.find("until") != nullptr) refuse("until", "the answer ends it");
  if (phase.motor) refuse("motor", "the motor must be off");
  if (phase.brake.action() != BrakeAction::released) refuse("brake", "the brake must be off");
  phase.until = {{.kind = experiment::EndKind::answer, .place = entry.place}};
}

[[noreturn]] void refuse_event(const Script& script, const EventScript& event, std::string_view what,
                               const std::string& problem) {
  throw ConfigError(fmt::format("{}: this change of {} {}", script.at(event.place), what, problem));
}

/// Refuses changes of one part that overlap, or that count from different times.
void check_order(const Script& script, const EventScript& before, const EventScript& event, std::string_view what) {
  if (event.from_braking() != before.from_braking()) {
    refuse_event(script, event, what,
                 fmt::format("counts from {}, but the change in line {} does not; count both from the same time",
                             event.from_braking() ? "braking" : "the start", before.place.line));
  }
  if (event.at_s < before.end_s) {
    refuse_event(
        script, event, what,
        fmt::format("begins at {} s, before the change in line {} ends (at {} s); put them in order, without overlap",
                    event.at_s, before.place.line, before.end_s));
  }
  // A jump may follow a ramp at the ramp's end. At the time of another jump it would undo that one.
  if (event.at_s == before.at_s && event.at_s == event.end_s) {
    refuse_event(script, event, what,
                 fmt::format("comes at {} s, as the change in line {} does; leave one of them out", event.at_s,
                             before.place.line));
  }
}

std::optional<std::string> text_of_file(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return std::nullopt;
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  return std::string(std::istreambuf_iterator<char>(file), {});
}

/// A configuration folder of the user may lack experiments. Then those of the program serve.
fs::path experiments_dir() {
  const fs::path named = config_dir() / "experiments";
  std::error_code error;
  return fs::is_directory(named, error) ? named : own_config_dir() / "experiments";
}

}  // namespace

std::span<const ChangingPart> changing_parts() noexcept { return parts; }

void BrakeScript::check(const TableReader& reader) {
  if (reader.entries().size() != 1) {
    reader.fail(reader.place(),
                fmt::format("brake holds {} keys: give one of duty, torque_Nm and slip_ref", reader.entries().size()));
  }
  word.clear();
}

BrakeAction BrakeScript::action() const noexcept {
  if (duty) return BrakeAction::duty;
  if (torque) return BrakeAction::torque;
  return word == "off" ? BrakeAction::released : BrakeAction::slip_control;
}

const std::optional<ProfileScript>& BrakeScript::profile() const noexcept {
  if (duty) return duty;
  return torque ? torque : slip_ref;
}

void PhaseScript::check(const TableReader& reader) {
  name_place = reader.find("name")->place;
  check_name(*this, reader);
  const auto refuse = [&](std::string_view key, std::string_view why) {
    reader.fail(reader.find(key)->key_place, fmt::format("phase \"{}\": {}", name, why));
  };
  const BrakeAction action = brake.action();
  if (motor && action != BrakeAction::released) {
    refuse("brake", "motor and brake must not act together; leave one of them out");
  }
  if (reader.find("ask") != nullptr) {
    check_ask(*this, reader);
  } else if (reader.find("until") == nullptr) {
    reader.fail(place, fmt::format("phase \"{}\" has no \"until\" (what ends it); give one", name));
  }
  if (restart && action != BrakeAction::slip_control) {
    refuse("restart",
           "restart needs a slip controller; give brake = \"controller\" or { slip_ref }, or leave restart out");
  }
  if (wheels_apart && action == BrakeAction::slip_control) {
    refuse("wheels_apart",
           "wheels that are apart have no slip to control; give brake = { duty } or { torque_Nm }, or leave "
           "wheels_apart out");
  }
  const auto lasts = [](const ConditionScript& c) { return c.kind == experiment::EndKind::duration && !c.when; };
  if (!at_most && std::ranges::none_of(until, lasts)) {
    reader.fail(place, fmt::format("phase \"{}\" may never end; give at_most_s, after which it is a fault", name));
  }
}

void EventScript::check(const TableReader& reader) {
  if (const Entry* entry = reader.find("inject")) {
    if (reader.entries().size() != 1) {
      reader.fail(entry->key_place,
                  "an event with inject takes no other key; give the time in inject, as in \"brake@write:off+0.2s\"");
    }
    try {
      if (parse_injections(inject).empty()) reader.fail(entry->place, "inject is empty; give a fault");
    } catch (const std::invalid_argument& error) {
      reader.fail(entry->place, error.what());
    }
    return;
  }
  if (std::ranges::none_of(parts, [this](const ChangingPart& part) { return (this->*part.factor).has_value(); })) {
    reader.fail(place,
                "the event changes nothing; give friction, brake_torque, motor_torque, upper_bearing, lower_bearing or "
                "inject");
  }
  if (reader.find("at") == nullptr) reader.fail(place, "the event has no \"at_s\" (when); give one");
  const Entry* over = reader.find("over");
  const Entry* until = reader.find("until");
  if (over != nullptr && until != nullptr) {
    reader.fail(until->key_place, fmt::format("{} and {} both say how long the change takes; leave one of them out",
                                              over->key, until->key));
  }
  if (until == nullptr) {
    end_s = at_s + over_s;
  } else if (end_s <= at_s) {
    reader.fail(until->place,
                fmt::format("{} = {}: the change begins at {} s; give a later end, or leave it out for a jump",
                            until->key, shown(*until->node), at_s));
  }
}

void SeriesScript::check(const TableReader& reader) const {
  const Entry* entry = reader.find("seeds");
  if (entry != nullptr && (reader.find("repeat") != nullptr || reader.find("seed") != nullptr)) {
    reader.fail(entry->key_place, "seeds replaces repeat and seed; leave one or the other out");
  }
}

void Script::check(const TableReader& reader) {
  series.given = reader.find("series") != nullptr || reader.find("factors") != nullptr;
  for (const char* key : {"phase", "limits", "event", "analysis", "settings"}) {
    const Entry* entry = reader.find(key);
    if (entry == nullptr || series.experiments.empty()) continue;
    reader.fail(entry->key_place, fmt::format("[series] names experiments, which have their own {}; leave {} out here, "
                                              "or experiments in [series]",
                                              key, key));
  }
  if (phases.empty() && series.experiments.empty()) {
    reader.fail(reader.place(), "the script has no \"phase\" (the phases, in order); give one");
  }
  for (auto phase = phases.begin(); phase != phases.end(); ++phase) {
    const auto same = std::find_if(phases.begin(), phase, [&](const auto& other) { return other.name == phase->name; });
    if (same == phase) continue;
    reader.fail(phase->name_place,
                fmt::format("the phase in line {} is also named \"{}\"; give each phase its own name", same->place.line,
                            phase->name));
  }
  double runs = static_cast<double>(series.repetitions() * std::max<std::size_t>(1, series.experiments.size()));
  for (const Factor& factor : factors) {
    if (!script_may_set(factor.key)) {
      reader.fail(factor.place, fmt::format("a script must not set {}; use --config or --set", factor.key));
    }
    if (factor.key == "run.seed") {
      reader.fail(factor.place, "[factors] of a series takes no run.seed; give repeat or seeds in [series]");
    }
    if (factor.has_range()) {
      reader.fail(
          factor.place,
          fmt::format("{}: a series runs every value; give steps in its range, or a list of values", factor.key));
    }
    runs *= static_cast<double>(std::get<Levels>(factor.values).values.size());
  }
  if (runs > static_cast<double>(most_runs)) {
    reader.fail(reader.place(), fmt::format("the series has {:.0f} runs; give at most {}", runs, most_runs));
  }
  files = reader.source().named_files();
  for (const ChangingPart& part : parts) static_cast<void>(profile(*this, part.what));
}

std::string Script::at(Place place) const { return fmt::format("{}:{}:{}", path, place.line, place.column); }

std::string profile(const Script& script, std::string_view what) {
  const auto part = std::ranges::find(parts, what, &ChangingPart::what);
  std::string text;
  const EventScript* before = nullptr;
  for (const EventScript& event : script.events) {
    const std::optional<double>& factor = event.*part->factor;
    if (!factor) continue;
    const bool jump = event.at_s == event.end_s;
    if (before != nullptr) {
      check_order(script, *before, event, what);
    } else {
      // A jump at 0 changes nothing during the run: its factor holds from the start.
      const bool from_the_start = jump && event.at_s == 0.0;
      text = fmt::format("{}: {}", event.from_braking() ? "braking time" : "time", from_the_start ? *factor : 1.0);
      if (from_the_start) {
        before = &event;
        continue;
      }
    }
    text += jump ? fmt::format("; {} at {}", *factor, event.at_s)
                 : fmt::format("; {} from {} to {}", *factor, event.at_s, event.end_s);
    before = &event;
  }
  return text;
}

std::vector<SeriesMember> members_of(const Script& script, std::int64_t seed) {
  const SeriesScript& series = script.series;
  std::vector<std::int64_t> seeds = series.seeds;
  for (std::int64_t k = 0; seeds.size() < series.repetitions(); ++k) seeds.push_back(series.seed.value_or(seed) + k);
  std::vector<SeriesMember> members(1);
  const auto combine = [&members](const std::string& key, const auto& values) {
    std::vector<SeriesMember> longer;
    for (const SeriesMember& shorter : members) {
      for (const auto& value : values) {
        longer.push_back(shorter);
        longer.back().varied.emplace_back(key, value);
      }
    }
    members = std::move(longer);
  };
  if (!series.experiments.empty()) combine("experiment.name", series.experiments);
  for (const Factor& factor : script.factors) combine(factor.key, std::get<Levels>(factor.values).values);
  std::vector<SeriesMember> all;
  for (const SeriesMember& member : members) {
    for (const std::int64_t own : seeds) all.push_back({member.varied, own});
  }
  return all;
}

Script parse(std::string text, std::string path, const FileReader& read_file) {
  Script script;
  script.name = path;
  script.path = path;
  script.text = std::move(text);
  const Source source(std::move(path), read_file);
  read_table(source, source.parsed(script.text), {1, 1}, script);
  return script;
}

Script load(const std::string& path) {
  const fs::path file(path);
  std::optional<std::string> text = text_of_file(file);
  if (!text) {
    throw ConfigError(
        fmt::format("{}: no such file, or it cannot be read; give an experiment by name or a TOML file", path));
  }
  return parse(std::move(*text), path,
               [&file](const std::string& name) { return text_of_file(file.parent_path() / name); });
}

std::shared_ptr<const Script> find(const std::string& name_or_file) {
  static std::mutex mutex;
  static std::map<std::string, std::shared_ptr<const Script>> read;
  const std::string file = named_file(&experiments_dir, "unknown experiment", name_or_file, "--experiment").string();
  const std::scoped_lock lock(mutex);
  std::shared_ptr<const Script>& script = read[file];
  if (!script) {
    Script fresh = load(file);
    fresh.name = name_or_file;
    script = std::make_shared<const Script>(std::move(fresh));
  }
  return script;
}

std::vector<std::shared_ptr<const Script>> known_experiments() {
  std::vector<std::shared_ptr<const Script>> scripts;
  for (const std::string& name : names_in(experiments_dir())) scripts.push_back(find(name));
  return scripts;
}

}  // namespace abs_hil::config

#include "config/script.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "config/config_error.hpp"
#include "config/events.hpp"
#include "config/reader.hpp"
#include "driver/injection/injection.hpp"
#include "rig/parse_toml.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::config {

namespace {

using experiment::BrakeAction;

constexpr std::array<rig::Phase, 6> kinds{rig::Phase::idle,  rig::Phase::accelerate, rig::Phase::coast,
                                          rig::Phase::brake, rig::Phase::hold,       rig::Phase::stopped};

std::optional<rig::Phase> kind_of_name(std::string_view name) {
  for (const rig::Phase kind : kinds) {
    if (rig::name_of(kind) == name) return kind;
  }
  return std::nullopt;
}

class Parser {
 public:
  Parser(const Source& source, const FileReader& read_file, Script& script)
      : source_(source), read_file_(read_file), script_(script) {}

  void read(const toml::table& table) {
    const TableReader root(source_, table, script_grammar(), {1, 1});
    script_.description = root.text_or_empty("description");
    script_.author = root.text_or_empty("author");
    script_.notes = root.text_or_empty("notes");
    if (const Entry* analysis = root.find("analysis")) script_.analysis = root.choice(*analysis);
    script_.series = read_series(source_, root);
    read_phases(root);
    if (const Entry* limits = root.find("limits")) read_limits(root.table(*limits), limits->place);
    if (const Entry* events = root.find("event")) {
      for (const toml::table* event : root.tables(*events)) script_.events.push_back(read_event(*event, events->place));
    }
    for (const ChangingPart& part : changing_parts()) static_cast<void>(profile(script_, part.what));
    script_.settings = read_settings(source_, root);
  }

 private:
  void read_phases(const TableReader& root) {
    const Entry* phases = root.find("phase");
    if (!script_.series.of_experiments) {
      if (phases == nullptr) source_.fail(root.place(), "the script has no \"phase\" (the phases, in order); give one");
      for (const toml::table* phase : root.tables(*phases)) script_.phases.push_back(read_phase(*phase, phases->place));
      return;
    }
    // These belong to the experiments that are run.
    for (const char* key : {"phase", "limits", "event", "analysis", "settings"}) {
      if (const Entry* entry = root.find(key)) {
        source_.fail(entry->key_place, fmt::format("[series] names experiments, which have their own {}; leave {} out "
                                                   "here, or experiments in [series]",
                                                   key, key));
      }
    }
  }

  PhaseScript read_phase(const toml::table& table, Place place) {
    const TableReader reader(source_, table, phase_grammar(), place);
    PhaseScript phase;
    phase.name = reader.text(*reader.find("name"));
    phase.place = reader.place();
    check_name(phase, reader);
    if (const Entry* kind = reader.find("kind")) phase.kind = kind_of_name(reader.choice(*kind));
    phase.when = reader.optional_when();
    if (const Entry* motor = reader.find("motor")) phase.motor = read_motor(*motor);
    if (const Entry* brake = reader.find("brake")) read_brake(reader, *brake, phase);
    if (phase.motor && phase.brake != BrakeAction::released) {
      source_.fail(
          reader.find("brake")->key_place,
          fmt::format("phase \"{}\": motor and brake must not act together; leave one of them out", phase.name));
    }
    phase.at_most = reader.optional_number("at_most");
    const Entry* until = reader.find("until");
    if (const Entry* ask = reader.find("ask")) {
      read_ask(reader, *ask, until, phase);
    } else if (until == nullptr) {
      source_.fail(phase.place, fmt::format("phase \"{}\" has no \"until\" (what ends it); give one", phase.name));
    } else {
      phase.until = read_until(source_, reader.table(*until), until->place);
    }
    if (const Entry* restart = reader.find("restart")) phase.restart = read_restart(*restart, phase);
    if (const Entry* apart = reader.find("wheels_apart")) phase.wheels_apart = read_wheels_apart(*apart, phase);
    const auto lasts = [](const ConditionScript& c) { return c.kind == experiment::EndKind::duration && !c.when; };
    if (!phase.at_most && std::none_of(phase.until.begin(), phase.until.end(), lasts)) {
      source_.fail(phase.place,
                   fmt::format("phase \"{}\" may never end; give at_most_s, after which it is a fault", phase.name));
    }
    return phase;
  }

  void read_ask(const TableReader& reader, const Entry& entry, const Entry* until, PhaseScript& phase) const {
    phase.ask = reader.text(entry);
    constexpr std::size_t longest = 200;
    const bool plain = !phase.ask.empty() && phase.ask.size() <= longest &&
                       std::all_of(phase.ask.begin(), phase.ask.end(), [](char c) { return c >= ' ' && c <= '~'; });
    if (!plain) {
      source_.fail(entry.place, fmt::format("ask = {}: give a line of 1 to {} printable ASCII characters",
                                            shown(*entry.node), longest));
    }
    const auto refuse = [&](const Entry& other, std::string_view why) {
      source_.fail(other.key_place,
                   fmt::format("phase \"{}\" asks a person: {}; leave {} out", phase.name, why, other.key));
    };
    if (until != nullptr) refuse(*until, "the answer ends it");
    if (phase.motor) refuse(*reader.find("motor"), "the motor must be off");
    if (phase.brake != BrakeAction::released) refuse(*reader.find("brake"), "the brake must be off");
    phase.until = {{.kind = experiment::EndKind::answer, .place = entry.place}};
  }

  void check_name(const PhaseScript& phase, const TableReader& reader) const {
    const Entry& entry = *reader.find("name");
    const bool plain = !phase.name.empty() && phase.name.size() <= rig::phase_name_max &&
                       phase.name.find_first_of("\n\r\t\",") == std::string::npos;
    if (!plain) {
      source_.fail(entry.place,
                   fmt::format("name = {}: give a name of 1 to 40 characters without quotes, commas and line ends",
                               shown(*entry.node)));
    }
    for (const PhaseScript& other : script_.phases) {
      if (other.name == phase.name) {
        source_.fail(entry.place, fmt::format("the phase in line {} is also named \"{}\"; give each phase its own name",
                                              other.place.line, phase.name));
      }
    }
  }

  std::optional<ProfileScript> read_motor(const Entry& entry) {
    if (const auto* text = entry.node->as_string(); text != nullptr && text->get() == "off") return std::nullopt;
    if (const auto* text = entry.node->as_string();
        text != nullptr && !text->get().starts_with('$') && !parse_quantity(text->get(), Quantity::none)) {
      source_.fail(entry.place,
                   fmt::format("motor = {}: give \"off\", a duty in {}, or a profile of duties {{ from, to, "
                               "over_s }}, {{ before, after, at_s }}, {{ points }}, {{ file }}",
                               shown(*entry.node), entry.field->facts.range.text()));
    }
    return read_profile_script(source_, entry, read_file_, script_.files);
  }

  void read_brake(const TableReader& phase_reader, const Entry& entry, PhaseScript& phase) {
    if (entry.node->is_string()) {
      if (phase_reader.choice(entry) == "controller") phase.brake = BrakeAction::slip_control;
      return;
    }
    if (!entry.node->is_table()) {
      source_.fail(entry.place, fmt::format("brake = {}: give \"off\", \"controller\", {{ duty }}, {{ torque_Nm }} or "
                                            "{{ slip_ref }}",
                                            shown(*entry.node)));
    }
    const TableReader reader(source_, *entry.node->as_table(), brake_grammar(), entry.place);
    if (reader.entries().size() != 1) {
      source_.fail(reader.place(), fmt::format("brake holds {} keys: give one of duty, torque_Nm and slip_ref",
                                               reader.entries().size()));
    }
    const Entry& what = reader.entries().front();
    phase.brake = what.field->facts.key == "duty"     ? BrakeAction::duty
                  : what.field->facts.key == "torque" ? BrakeAction::torque
                                                      : BrakeAction::slip_control;
    phase.brake_profile = read_profile_script(source_, what, read_file_, script_.files);
  }

  void require_true(const Entry& entry) const {
    const auto* flag = entry.node->as_boolean();
    if (flag == nullptr || !flag->get()) {
      source_.fail(entry.place, fmt::format("{} = {}: write true", entry.key, shown(*entry.node)));
    }
  }

  [[nodiscard]] bool read_wheels_apart(const Entry& entry, const PhaseScript& phase) const {
    require_true(entry);
    if (phase.brake == BrakeAction::slip_control) {
      source_.fail(entry.key_place, fmt::format("phase \"{}\": wheels that are apart have no slip to control; give "
                                                "brake = {{ duty }} or {{ torque_Nm }}, or leave wheels_apart out",
                                                phase.name));
    }
    return true;
  }

  [[nodiscard]] bool read_restart(const Entry& entry, const PhaseScript& phase) const {
    require_true(entry);
    if (phase.brake != BrakeAction::slip_control) {
      source_.fail(entry.key_place, fmt::format("phase \"{}\": restart needs a slip controller; give brake = "
                                                "\"controller\" or {{ slip_ref }}, or leave restart out",
                                                phase.name));
    }
    return true;
  }

  void read_limits(const toml::table& table, Place place) {
    const TableReader reader(source_, table, limits_grammar(), place);
    script_.limits = {reader.optional_number("wheel_speed"), reader.optional_number("motor_duty"),
                      reader.optional_number("brake_duty"), reader.optional_number("run_time"),
                      reader.optional_number("distance")};
  }

  EventScript read_event(const toml::table& table, Place place) {
    const TableReader reader(source_, table, event_grammar(), place);
    EventScript event;
    event.place = reader.place();
    if (const Entry* inject = reader.find("inject")) return read_fault(reader, *inject);
    for (const ChangingPart& part : changing_parts()) {
      if (const Entry* entry = reader.find(part.what)) {
        event.changes.push_back({part.what, plain_number(reader, *entry)});
      }
    }
    if (event.changes.empty()) {
      source_.fail(reader.place(),
                   "the event changes nothing; give friction, brake_torque, motor_torque, "
                   "upper_bearing, lower_bearing or inject");
    }
    const Entry* at = reader.find("at");
    if (at == nullptr) source_.fail(reader.place(), "the event has no \"at_s\" (when); give one");
    event.at_s = event.end_s = plain_number(reader, *at);
    if (const Entry* from = reader.find("counted_from")) event.from_braking = reader.choice(*from) == "braking";
    const Entry* over = reader.find("over");
    if (over != nullptr) event.end_s += plain_number(reader, *over);
    if (const Entry* until = reader.find("until")) read_end(*until, over, reader, event);
    return event;
  }

  void read_end(const Entry& until, const Entry* over, const TableReader& reader, EventScript& event) const {
    if (over != nullptr) {
      source_.fail(until.key_place, fmt::format("{} and {} both say how long the change takes; leave one of them out",
                                                over->key, until.key));
    }
    event.end_s = plain_number(reader, until);
    if (event.end_s <= event.at_s) {
      source_.fail(until.place, fmt::format("{} = {}: the change begins at {} s; give a later end, or leave it out for "
                                            "a jump",
                                            until.key, shown(*until.node), event.at_s));
    }
  }

  [[nodiscard]] double plain_number(const TableReader& reader, const Entry& entry) const {
    const Number number = reader.number(entry);
    if (!number.key.empty()) source_.fail(number.place, "an event takes no $key; give a number");
    return number.value;
  }

  [[nodiscard]] EventScript read_fault(const TableReader& reader, const Entry& entry) const {
    if (reader.entries().size() != 1) {
      source_.fail(entry.key_place,
                   "an event with inject takes no other key; give the time in inject, as in \"brake@write:off+0.2s\"");
    }
    EventScript event;
    event.inject = reader.text(entry);
    event.place = reader.place();
    config::Settings settings;
    settings.inject = event.inject;
    try {
      if (driver::parse_injections(settings.inject).empty()) source_.fail(entry.place, "inject is empty; give a fault");
    } catch (const std::invalid_argument& error) {
      source_.fail(entry.place, error.what());
    }
    return event;
  }

  const Source& source_;
  const FileReader& read_file_;
  Script& script_;
};

std::optional<std::string> text_of(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  if (!file) return std::nullopt;
  return text.str();
}

}  // namespace

std::string Script::at(Place place) const { return fmt::format("{}:{}:{}", path, place.line, place.column); }

Script parse(std::string text, std::string path, const FileReader& read_file) {
  Script script{.name = path, .path = path, .text = std::move(text)};
  const Source source(std::move(path));
  try {
    const toml::table table = rig::parse_toml(script.text, script.path);
    Parser(source, read_file, script).read(table);
  } catch (const toml::parse_error& problem) {
    source.fail(place_of(problem.source()), fmt::format("not valid TOML: {}", problem.description()));
  }
  return script;
}

Script load(const std::string& path) {
  const std::filesystem::path file(path);
  std::optional<std::string> text = text_of(file);
  if (!text) {
    throw config::ConfigError(
        fmt::format("{}: no such file, or it cannot be read; give an experiment by name or a TOML file", path));
  }
  return parse(std::move(*text), path, [&file](const std::string& name) { return text_of(file.parent_path() / name); });
}

}  // namespace abs_hil::config

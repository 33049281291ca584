// Merges what people and files say about a run. `read_sources` has the order of the sources; the checks beside it
// refuse what contradicts.
#include "config/merge.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "abs_hil/control/registry.hpp"
#include "config/board_policy.hpp"
#include "config/config_error.hpp"
#include "config/injection.hpp"
#include "config/key_table.hpp"
#include "config/plan.hpp"
#include "rig/formatted_text.hpp"
#include "rig/nearest_name.hpp"

namespace abs_hil::config {

namespace {

constexpr const char* experiment_key = "experiment.name";

/// The mode of --rt; none: real time is required on a real board, otherwise preferred.
runtime::RealtimeMode realtime_mode(const std::optional<std::string>& name, const Settings& s) {
  if (!name) {
    const bool real = s.on_rig() && is_real_board(s.driver);
    return real ? runtime::RealtimeMode::require : runtime::RealtimeMode::prefer;
  }
  if (*name == "require") return runtime::RealtimeMode::require;
  return *name == "off" ? runtime::RealtimeMode::off : runtime::RealtimeMode::prefer;
}

/// Logs a warning once: each run of a series is merged anew.
void warn_once(const std::string& text) {
  static std::mutex mutex;
  static std::set<std::string> logged;
  const std::scoped_lock lock(mutex);
  if (logged.insert(text).second) spdlog::warn("{}", text);
}

/// Refuses events that only a simulated plant can carry out, and fault injection into real hardware.
void refuse_events(const Script& script, bool emulated) {
  for (const EventScript& event : script.events) {
    for (const ChangingPart& part : changing_parts()) {
      if (!(event.*part.factor)) continue;
      throw ConfigError(
          fmt::format("{}: [[event]] {}: only a simulated plant can change on command; run experiment {} with "
                      "--backend sim, or leave its events out for the rig",
                      script.at(event.place), part.what, script.name));
    }
    if (!emulated) {
      throw ConfigError(
          fmt::format("{}: [[event]] inject: faults are never injected into real hardware; run experiment {} with "
                      "--backend sim, or leave its events out for the rig",
                      script.at(event.place), script.name));
    }
  }
}

/// A misspelt key in the list of consents consents to nothing, and somebody believes that it does.
void check_consents(const Settings& s, const KeyTable& keys) {
  if (s.unsafe.keys.empty()) return;
  std::vector<std::string_view> names;
  for (const Key& key : keys.keys()) names.push_back(key.name);
  for (const std::string_view name : rig::split(s.unsafe.keys, ',')) {
    if (find_key(keys.keys(), name) != nullptr) continue;
    throw ConfigError(fmt::format(
        "unsafe.keys: unknown key \"{}\"; the nearest known key is {}; give keys separated by commas, without blanks",
        name, fmt::join(rig::nearest_keys(name, names), " or ")));
  }
}

/// The names of plant and model. On a rig the plant's name is the model's.
void set_names(Settings& s, const Sources& sources) {
  if (sources.plant) s.plant_name = *sources.plant;
  if (sources.model) s.model_name = *sources.model;
  if (!s.on_rig()) return;
  if (!sources.model) s.model_name = s.plant_name;
  s.plant_name = s.model_name;
}

/// Keys of the rig's identity that nobody has set come from the file that it names: first from its [plant], which
/// describes a rig, then from its [model].
void complete_identity(const Settings& s, KeyTable& keys) {
  const std::vector<FileValue> values = read_file(plant_file(s.rig.source, "rig.identity"), Tables::of_plant);
  for (const std::string_view table : {"plant.", "model."}) {
    for (const FileValue& value : values) {
      if (!value.name.starts_with(table)) continue;
      const std::string name = "rig." + value.name.substr(table.size());
      if (find_key(keys.keys(), name) != nullptr && !keys.was_set(name)) keys.set(name, value.value, value.origin);
    }
  }
}

constexpr std::int64_t prior_format = 1;

/// The values of a prior (--prior: what the controller has learnt of the rig in the last braking), without its head,
/// which says for which model it holds. A file that is not there is the first braking's, and has none.
/// @param model  name of the run's model
/// Throws ConfigError for a file that is none, of another format, or learnt with another model.
std::vector<FileValue> read_prior(const std::filesystem::path& file, std::string_view model) {
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error) return {};
  std::vector<FileValue> values = read_file(file);
  const auto refuse = [&](const std::string& why) {
    throw ConfigError(
        fmt::format("--prior {}: {}; give the file that a run with --prior has written, or remove it to begin anew",
                    file.string(), why));
  };
  const auto taken = [&](std::string_view name) {
    const auto found = std::ranges::find(values, name, &FileValue::name);
    if (found == values.end()) refuse(fmt::format("has no {}", name));
    const Value value = found->value;
    values.erase(found);
    return value;
  };
  if (taken("prior.format") != Value(prior_format)) refuse(fmt::format("is not of format {}", prior_format));
  if (taken("prior.model") != Value(std::string(model)))
    refuse(fmt::format("was learnt with another model than {}, which is that of this run", model));
  for (const FileValue& value : values) {
    if (!value.name.starts_with("control.")) refuse(fmt::format("holds {}, which no controller learns", value.name));
  }
  return values;
}

/// What files and people say, later ones above earlier ones. The settings of the script rank between the two lists.
struct Said {
  std::vector<FileValue> below{};
  std::vector<FileValue> above{};
};

Said read_sources(const Sources& sources, Settings& s, const KeyTable& keys) {
  if (s.on_rig() && sources.plant) {
    throw ConfigError(fmt::format(
        "--plant {0}: a rig has no simulated plant; tell the controllers about it with --model {0}", *sources.plant));
  }
  Said said;
  const auto add = [](std::vector<FileValue>& to, const std::vector<FileValue>& values) {
    to.insert(to.end(), values.begin(), values.end());
  };
  const auto add_text = [&keys](std::vector<FileValue>& to, std::string_view assignment, const char* origin) {
    const auto [name, value] = keys.parsed(assignment, origin);
    to.push_back({name, value, origin});
  };
  for (const std::string& assignment : sources.defaults) add_text(said.below, assignment, "default");
  const std::filesystem::path plant = plant_file(sources.plant.value_or(s.plant_name));
  add(said.below, s.on_rig() ? read_model(plant) : read_file(plant, Tables::of_plant));
  if (sources.model) add(said.below, read_model(plant_file(*sources.model, "--model")));
  set_names(s, sources);
  if (sources.prior_file)
    add(said.above, read_prior(*sources.prior_file, s.model_name.empty() ? s.plant_name : s.model_name));
  if (sources.config_file) add(said.above, read_file(*sources.config_file));
  const auto add_option = [&](const char* key, const std::optional<std::string>& value, const char* option) {
    if (value) add_text(said.above, fmt::format("{}={}", key, *value), option);
  };
  add_option("control.controller", sources.controller, "--controller");
  add_option(experiment_key, sources.experiment, "--experiment");
  add_option("control.slip_ref", sources.slip_ref, "--slip-ref");
  add_option("control.rate_Hz", sources.rate_Hz, "--rate");
  add_option("run.seed", sources.seed, "--seed");
  for (const std::string& assignment : sources.assignments) add_text(said.above, assignment, "--set");
  add(said.above, sources.changes);
  if (sources.wait_for_start) add_text(said.above, "experiment.wait_for_start=true", "--wait-for-start");
  return said;
}

/// The experiment that options and files name: its script's settings rank below theirs, so it must be known before they
/// are set. A name that is no text is refused when it is set.
std::shared_ptr<const Script> script_of(const Sources& sources, const Said& said) {
  std::string name = experiment::ExperimentOptions().name;
  for (const auto* values : {&said.below, &said.above}) {
    for (const FileValue& value : *values) {
      const auto* text = std::get_if<std::string>(&value.value);
      if (text != nullptr && value.name == experiment_key) name = *text;
    }
  }
  std::shared_ptr<const Script> script = find(name);
  if (!sources.one_of_series) return script;
  auto single = std::make_shared<Script>(*script);
  single->series.given = false;
  return single;
}

/// Everything but what the script asks for beyond its settings.
void fill(Settings& s, KeyTable& keys, const Sources& sources, const Said& said, const Script& script) {
  set_all(said.below, keys);
  for (const Setting& setting : script.settings) keys.set(setting.key, setting.value, script.at(setting.place));
  set_all(said.above, keys);
  for (const std::string& injection : sources.injections) {
    if (parse_injections(injection).empty()) throw ConfigError("--inject is empty; give a fault, or leave it out");
    s.inject += (s.inject.empty() ? "" : ",") + injection;
  }
  if (s.on_rig()) complete_identity(s, keys);
  s.realtime.mode = realtime_mode(sources.realtime, s);
}

/// The script of a series of experiments has no phases: its members are judged one by one.
SafetyView view_of(const Script& script, const Settings& s, const KeyTable& keys) {
  return safety_view(s, keys, script.phases.empty() ? Plan{} : plan(script, s));
}

/// What the sources say, before anything judges it.
void read_into(Configuration& merged, KeyTable& keys, const Sources& sources) {
  Settings& s = merged.settings;
  s.backend = sources.backend;
  if (s.on_rig()) keys.leave_out_plant();
  const Said said = read_sources(sources, s, keys);
  merged.script = script_of(sources, said);
  fill(s, keys, sources, said, *merged.script);
}

/// Everything but the texts of the configuration.
void merge_into(Configuration& merged, KeyTable& keys, const Sources& sources) {
  read_into(merged, keys, sources);
  Settings& s = merged.settings;
  const Script& script = *merged.script;
  if (s.control.adaptive.theta_min_N >= s.control.adaptive.theta_max_N) {
    throw ConfigError("control.adaptive.theta_min_N: give a value below control.adaptive.theta_max_N");
  }
  if (s.on_rig()) refuse_events(script, s.driver.emulated);
  apply(script, s);
  static_cast<void>(parse_injections(s.inject));  // in simulation too, a fault is spelled right or refused
  if (s.on_rig()) {
    check_consents(s, keys);
    const SafetyView view = view_of(script, s, keys);
    for (const std::string& weak : refuse_unsafe_use(s, view, sources.virtual_time)) warn_once(weak);
    apply_board_limits(s, keys);
  }
  for (const std::string& problem : theta_out_of_bounds(s)) warn_once(problem);
  for (const std::string& problem : negative_at_dead_zone(s)) warn_once(problem);
  if (const std::string problem = standstill_too_early(s); !problem.empty()) warn_once(problem);
  if (const std::string problem = slip_out_of_reach(script, s); !problem.empty()) warn_once(problem);
  if (!asks(script)) return;
  if (s.experiment.answers == "auto") s.experiment.answers = sources.answered_by;
  if (sources.virtual_time && s.experiment.answers == experiment::answers_person) {
    throw ConfigError(
        fmt::format("experiment {} asks a person: a run in virtual time (--fast) cannot wait; leave out --fast, or "
                    "experiment.answers = person",
                    script.name));
  }
}

/// The texts of the configuration.
void write_texts(Configuration& merged, const KeyTable& keys) {
  const Settings& s = merged.settings;
  nlohmann::ordered_json json = keys.to_json();
  json["experiment_script"] = merged.script->text;
  if (!merged.script->files.empty()) json["experiment_files"] = merged.script->files;
  merged.json = json.dump();
  const std::string plant = s.on_rig() ? "" : " --plant " + s.plant_name;
  const std::string model = s.model_name.empty() ? "" : " --model " + s.model_name;
  merged.toml = fmt::format(
      "# Effective configuration of a run. To run it again: abs_hil --backend {}{}{} --config THIS_FILE\n{}", s.backend,
      plant, model, keys.to_toml());
}

}  // namespace

Configuration merge(const Sources& sources) {
  Configuration merged;
  KeyTable keys(merged.settings);
  merge_into(merged, keys, sources);
  write_texts(merged, keys);
  return merged;
}

SafetyView safety_view(const Sources& sources) {
  Configuration merged;
  KeyTable keys(merged.settings);
  read_into(merged, keys, sources);
  apply(*merged.script, merged.settings);
  return view_of(*merged.script, merged.settings, keys);
}

Settings merged_settings(const Sources& sources) {
  Configuration merged;
  KeyTable keys(merged.settings);
  merge_into(merged, keys, sources);
  return std::move(merged.settings);
}

Configuration configuration_of(Settings settings) {
  Configuration made{.settings = std::move(settings)};
  const Settings& s = made.settings;
  made.script = find(s.experiment.name);
  KeyTable keys(made.settings);
  // The whole model, so that its values follow neither a plant nor a model's file when the configuration is read again.
  const bool differs = !s.model_name.empty() || s.model != s.plant.rig;
  for (const Key& key : keys.keys()) {
    if (!differs || !key.name.starts_with("model.")) continue;
    keys.set(key.name, value_of(key), "model");
  }
  write_texts(made, keys);
  return made;
}

Sources sources_of(const std::vector<std::string>& words) {
  Sources sources{.virtual_time = true};
  const std::map<std::string_view, std::optional<std::string>*> named{
      {"--config", &sources.config_file}, {"--controller", &sources.controller}, {"--experiment", &sources.experiment},
      {"--model", &sources.model},        {"--plant", &sources.plant},           {"--seed", &sources.seed},
      {"--slip-ref", &sources.slip_ref}};
  for (std::size_t n = 0; n + 1 < words.size(); n += 2) {
    if (words[n] == "--set") {
      sources.assignments.push_back(words[n + 1]);
    } else if (const auto known = named.find(words[n]); known != named.end()) {
      *known->second = words[n + 1];
    } else {
      throw ConfigError("a run from words has no option " + words[n]);
    }
  }
  return sources;
}

void choose(const SeriesMember& member, Sources& sources) {
  for (const auto& [key, value] : member.varied) sources.changes.push_back({key, value, "[vary]"});
  sources.changes.push_back({"run.seed", member.seed, "[series]"});
  // An experiment that the series names is a script of its own: refuse_nested sees whether that is a series, too.
  sources.one_of_series =
      std::ranges::none_of(member.varied, [](const auto& varied) { return varied.first == experiment_key; });
}

nlohmann::ordered_json varied_json(const SeriesMember& member) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const auto& [key, value] : member.varied) json[key] = json_of(value);
  return json;
}

void refuse_nested(const Script& series, const Script& experiment) {
  if (!experiment.series.given) return;
  throw ConfigError(fmt::format("{}: {} is a series, too; name single experiments", series.path, experiment.name));
}

bool asks(const Script& script) noexcept {
  return std::ranges::any_of(script.phases, [](const PhaseScript& phase) { return !phase.ask.empty(); });
}

std::string prior_text(const nlohmann::ordered_json& learnt, std::string_view model) {
  std::string text = fmt::format(
      "# What the controller has learnt of the rig in its last braking. abs_hil --prior reads and renews it.\n"
      "prior.format = {}\nprior.model = {}\n",
      prior_format, nlohmann::json(model).dump());
  for (const auto& [key, value] : learnt.items()) text += fmt::format("{} = {}\n", key, value.dump());
  return text;
}

std::uint64_t sensor_seed(const Settings& s) {
  if (s.sensor_seed.empty()) return static_cast<std::uint64_t>(s.seed);
  if (const auto seed = rig::parse_number<std::uint64_t>(s.sensor_seed)) return *seed;
  throw ConfigError(fmt::format("run.sensor_seed = \"{}\" is not valid; give a whole number in [0, 2^64), or nothing",
                                s.sensor_seed));
}

}  // namespace abs_hil::config

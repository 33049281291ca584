#include "program/command_line.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "config/library.hpp"
#include "config/model.hpp"
#include "config/plan.hpp"
#include "driver/injection/injection.hpp"
#include "program/answers.hpp"
#include "rig/nearest_name.hpp"
#include "runtime/board_policy.hpp"

namespace abs_hil::program {

namespace {

constexpr const char* experiment_key = "experiment.name";

/// The mode of --rt; none: real time is required on a real board, otherwise preferred.
runtime::RealtimeMode realtime_mode(const std::optional<std::string>& name, const config::Settings& s) {
  if (!name) {
    const bool real = s.on_rig() && runtime::is_real_board(s.driver);
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

/// Checks that a run that waits for a start command can receive one.
void check_start(const RunRequest& request) {
  const config::Settings& s = request.settings;
  const auto refuse = [](const char* why) { throw config::ConfigError(std::string("--wait-for-start: ") + why); };
  if (!s.commands.enabled)
    refuse("the start command needs remote commands; add --set commands.enabled=true --set commands.key_file=FILE");
  if (request.outputs.no_lcm) refuse("the start command comes over LCM; leave out --no-lcm");
  if (request.outputs.fast) refuse("a run in virtual time cannot wait for a command; leave out --fast");
  if (s.experiment.start_speed_rad_s > 0.0) {
    refuse(
        "wheels that turn from the beginning would slow down during the wait; leave out experiment.start_speed_rad_s");
  }
}

/// Refuses events that only a simulated plant can carry out, and fault injection into real hardware.
void refuse_events(const config::Script& script, bool emulated) {
  for (const config::EventScript& event : script.events) {
    for (const config::ChangingPart& part : config::changing_parts()) {
      if (!(event.*part.factor)) continue;
      throw config::ConfigError(
          fmt::format("{}: [[event]] {}: only a simulated plant can change on command; run experiment {} with "
                      "--backend sim, or leave its events out for the rig",
                      script.at(event.place), part.what, script.name));
    }
    if (!emulated) {
      throw config::ConfigError(
          fmt::format("{}: [[event]] inject: faults are never injected into real hardware; run experiment {} with "
                      "--backend sim, or leave its events out for the rig",
                      script.at(event.place), script.name));
    }
  }
}

/// Options that contradict one another.
void check_together(const RunRequest& request) {
  const config::Settings& s = request.settings;
  if (request.outputs.fast && request.outputs.histogram_file) {
    throw config::ConfigError(
        "--histogram: a run in virtual time (--fast) has no latencies to measure; leave out one of the two");
  }
  if (s.experiment.wait_for_start) check_start(request);
  if (s.control.adaptive.theta_min_N >= s.control.adaptive.theta_max_N) {
    throw config::ConfigError("control.adaptive.theta_min_N: give a value below control.adaptive.theta_max_N");
  }
}

/// A misspelt key in the list of consents consents to nothing, and somebody believes that it does.
void check_consents(const config::Settings& s, const config::KeyTable& keys) {
  std::vector<std::string_view> names;
  for (const config::Key& key : keys.keys()) names.push_back(key.name);
  for (std::size_t begin = 0; begin < s.unsafe.keys.size();) {
    const std::size_t end = std::min(s.unsafe.keys.find(',', begin), s.unsafe.keys.size());
    const std::string name = s.unsafe.keys.substr(begin, end - begin);
    if (config::find_key(keys.keys(), name) == nullptr) {
      throw config::ConfigError(fmt::format(
          "unsafe.keys: unknown key \"{}\"; the nearest known key is {}; give keys separated by commas, without blanks",
          name, fmt::join(rig::nearest_keys(name, names), " or ")));
    }
    begin = end + 1;
  }
}

/// The policy of the board, after all settings are known.
void apply_board_policy(config::Settings& s, const config::KeyTable& keys, bool virtual_time) {
  check_consents(s, keys);
  const std::vector<std::string> accepted = runtime::refuse_unsafe_use(
      {.driver = s.driver,
       .guarded = s.guardian.enabled,
       .virtual_time = virtual_time,
       .rate_Hz = s.control.rate_Hz,
       .guardian_timeout_ms = s.guardian.timeout_ms,
       .unsafe = s.unsafe,
       .start_speed_rad_s = s.experiment.start_speed_rad_s,
       .injections = driver::parse_injections(s.inject),
       .controller_file = control::is_controller_file(s.control.controller) ? s.control.controller : "",
       .weak = config::weak_values(keys),
       .model_counts_per_rev = s.model.encoder_counts_per_rev,
       .rig_counts_per_rev = s.rig.parameters.encoder_counts_per_rev});
  for (const std::string& weak : accepted) warn_once(weak);
  runtime::refuse_caps_above_board({.brake = keys.was_set("gate.brake_duty_max") ? s.gate.brake_duty_max : 0.0,
                                    .motor = keys.was_set("gate.motor_duty_max") ? s.gate.motor_duty_max : 0.0},
                                   s.driver);
  runtime::apply_board_limits(s.rig.parameters, s.control.rate_Hz, s.gate, s.driver);
}

/// The configuration files of a run, each read once.
struct Files {
  std::vector<config::FileValue> plant{};
  std::vector<config::FileValue> model{};
  std::vector<config::FileValue> config{};
};

Files read_files(const RunOptions& options, const std::string& default_plant) {
  const bool on_rig = options.backend == "rig";
  if (on_rig && options.plant) {
    throw config::ConfigError(fmt::format(
        "--plant {0}: a rig has no simulated plant; tell the controllers about it with --model {0}", *options.plant));
  }
  const std::filesystem::path plant = config::plant_file(options.plant.value_or(default_plant));
  Files files{.plant = on_rig ? config::read_model(plant) : config::read_file(plant, config::Tables::of_plant)};
  if (options.model) files.model = config::read_model(config::plant_file(*options.model, "--model"));
  if (options.config_file) files.config = config::read_file(*options.config_file);
  return files;
}

std::vector<config::FileValue> settings_of(const config::Script& script) {
  std::vector<config::FileValue> values;
  for (const config::Setting& setting : script.settings) {
    values.push_back({setting.key, setting.value, script.at(setting.place)});
  }
  return values;
}

/// The names of plant and model. On a rig the plant's name is the model's.
void set_names(config::Settings& s, const RunOptions& options) {
  if (options.plant) s.plant_name = *options.plant;
  if (options.model) s.model_name = *options.model;
  if (!s.on_rig()) return;
  if (!options.model) s.model_name = s.plant_name;
  s.plant_name = s.model_name;
}

/// What nobody has set of the rig's identity comes from the file that it names: from its [plant], which describes a
/// rig, before its [model].
void complete_identity(const config::Settings& s, config::KeyTable& keys) {
  const std::vector<config::FileValue> values =
      config::read_file(config::plant_file(s.rig.source, "rig.identity"), config::Tables::of_plant);
  for (const std::string_view table : {"plant.", "model."}) {
    for (const config::FileValue& value : values) {
      if (!value.name.starts_with(table)) continue;
      const std::string name = "rig." + value.name.substr(table.size());
      if (config::find_key(keys.keys(), name) != nullptr && !keys.was_set(name))
        keys.set(name, value.value, value.origin);
    }
  }
}

/// Everything but what the script asks for beyond its settings.
void fill(config::Settings& s, config::KeyTable& keys, const RunOptions& options, const Files& files,
          const config::Script& script) {
  s.backend = options.backend;
  if (s.on_rig()) keys.leave_out_plant();
  for (const std::string& assignment : options.defaults) keys.set_text(assignment, "default");
  set_names(s, options);
  config::set_all(files.plant, keys);
  config::set_all(files.model, keys);
  config::set_all(settings_of(script), keys);
  config::set_all(files.config, keys);

  const auto set = [&keys](const char* key, const std::optional<std::string>& value, const char* option) {
    if (value) keys.set_text(std::string(key) + '=' + *value, option);
  };
  set("control.controller", options.controller, "--controller");
  set(experiment_key, options.experiment, "--experiment");
  set("control.slip_ref", options.slip_ref, "--slip-ref");
  set("control.rate_Hz", options.rate_Hz, "--rate");
  set("run.seed", options.seed, "--seed");
  for (const std::string& assignment : options.assignments) keys.set_text(assignment, "--set");
  config::set_all(options.changes, keys);
  for (const std::string& injection : options.injections) s.inject += (s.inject.empty() ? "" : ",") + injection;
  if (options.wait_for_start) keys.set_text("experiment.wait_for_start=true", "--wait-for-start");
  if (s.on_rig()) complete_identity(s, keys);
  s.realtime.mode = realtime_mode(options.realtime, s);
}

/// The experiment that options and files name: its script's settings rank below theirs, so it must be known before they
/// are set. A name that is no text is refused when it is set.
std::shared_ptr<const config::Script> script_of(const RunOptions& options, const Files& files) {
  std::string name = experiment::ExperimentOptions().name;
  const auto look = [&name](const std::vector<config::FileValue>& values) {
    for (const config::FileValue& value : values) {
      if (const auto* text = std::get_if<std::string>(&value.value); text != nullptr && value.name == experiment_key)
        name = *text;
    }
  };
  const auto look_at_texts = [&](const std::vector<std::string>& assignments) {
    for (const std::string& assignment : assignments) {
      const auto [key, text] = config::split_assignment(assignment, "--set");
      if (key == experiment_key) name = text;
    }
  };
  look_at_texts(options.defaults);
  look(files.config);
  name = options.experiment.value_or(name);
  look_at_texts(options.assignments);
  look(options.changes);
  std::shared_ptr<const config::Script> script = config::find(name);
  if (!options.one_of_series) return script;
  auto single = std::make_shared<config::Script>(*script);
  single->series.given = false;
  return single;
}

/// All of `request` but the texts of the configuration.
void merge_into(RunRequest& request, config::KeyTable& keys, const RunOptions& options) {
  const Files files = read_files(options, request.settings.plant_name);
  request.script = script_of(options, files);
  request.outputs = options.outputs;
  config::Settings& s = request.settings;
  const config::Script& script = *request.script;
  fill(s, keys, options, files, script);
  check_together(request);
  if (s.on_rig()) refuse_events(script, s.driver.emulated);
  config::apply(script, s);
  static_cast<void>(driver::parse_injections(s.inject));  // in simulation too, a fault is spelled right or refused
  if (s.on_rig()) apply_board_policy(s, keys, request.outputs.fast);
  for (const std::string& problem : config::theta_out_of_bounds(s)) warn_once(problem);
  for (const std::string& problem : config::negative_at_dead_zone(s)) warn_once(problem);
  if (const std::string problem = config::standstill_too_early(s); !problem.empty()) warn_once(problem);
  if (const std::string problem = config::slip_out_of_reach(script, s); !problem.empty()) warn_once(problem);
  if (s.experiment.answers == "auto" && asks(script)) s.experiment.answers = who_answers(request);
}

}  // namespace

void refuse_nested(const config::Script& series, const config::Script& experiment) {
  if (!experiment.series.given) return;
  throw config::ConfigError(
      fmt::format("{}: {} is a series, too; name single experiments", series.path, experiment.name));
}

config::Settings merged_settings(const RunOptions& options) {
  RunRequest request;
  config::KeyTable keys(request.settings);
  merge_into(request, keys, options);
  return std::move(request.settings);
}

namespace {

/// The texts of the effective configuration.
void write_configuration(RunRequest& request, const config::KeyTable& keys) {
  const config::Settings& s = request.settings;
  const config::Script& script = *request.script;
  nlohmann::ordered_json config = keys.to_json();
  config["experiment_script"] = script.text;
  if (!script.files.empty()) config["experiment_files"] = script.files;
  request.config_json = config.dump();
  const std::string plant = s.on_rig() ? "" : " --plant " + s.plant_name;
  const std::string model = s.model_name.empty() ? "" : " --model " + s.model_name;
  request.config_toml = fmt::format(
      "# Effective configuration of a run. To run it again: abs_hil --backend {}{}{} --config THIS_FILE\n{}", s.backend,
      plant, model, keys.to_toml());
}

}  // namespace

RunRequest merge(const RunOptions& options) {
  RunRequest request;
  config::KeyTable keys(request.settings);
  merge_into(request, keys, options);
  write_configuration(request, keys);
  return request;
}

nlohmann::ordered_json varied_json(const config::SeriesMember& member) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const auto& [key, value] : member.varied) {
    std::visit([&json, &key = key](const auto& v) { json[key] = v; }, value);
  }
  return json;
}

RunOptions options_of(const std::vector<std::string>& words) {
  RunOptions options{.outputs = {.fast = true, .no_lcm = true}};
  const std::map<std::string_view, std::optional<std::string>*> named{
      {"--config", &options.config_file}, {"--controller", &options.controller}, {"--experiment", &options.experiment},
      {"--model", &options.model},        {"--plant", &options.plant},           {"--seed", &options.seed},
      {"--slip-ref", &options.slip_ref}};
  for (std::size_t n = 0; n + 1 < words.size(); n += 2) {
    if (words[n] == "--set") {
      options.assignments.push_back(words[n + 1]);
    } else if (const auto known = named.find(words[n]); known != named.end()) {
      *known->second = words[n + 1];
    } else {
      throw config::ConfigError("a run from words has no option " + words[n]);
    }
  }
  return options;
}

RunOptions options_of(const RunOptions& common, const config::SeriesMember& member) {
  RunOptions options = common;
  for (const auto& [key, value] : member.varied) options.changes.push_back({key, value, "[vary]"});
  options.changes.push_back({"run.seed", member.seed, "[series]"});
  // An experiment that the series names is a script of its own: refuse_nested sees whether that is a series, too.
  options.one_of_series =
      std::ranges::none_of(member.varied, [](const auto& varied) { return varied.first == experiment_key; });
  return options;
}

RunRequest request_of(config::Settings settings, OutputOptions outputs) {
  RunRequest request{.settings = std::move(settings), .outputs = std::move(outputs)};
  request.script = config::find(request.settings.experiment.name);
  config::KeyTable keys(request.settings);
  // The whole model, so that its values follow neither a plant nor a model's file when the configuration is read again.
  const bool differs = !request.settings.model_name.empty() || request.settings.model != request.settings.plant.rig;
  for (const config::Key& key : keys.keys()) {
    if (!differs || !key.name.starts_with("model.")) continue;
    std::visit([&](const auto* value) { keys.set(key.name, *value, "model"); }, key.target);
  }
  write_configuration(request, keys);
  return request;
}

}  // namespace abs_hil::program

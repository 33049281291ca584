#include "program/command_line.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/events.hpp"
#include "config/key_table.hpp"
#include "config/library.hpp"
#include "config/plan.hpp"
#include "driver/injection/injection.hpp"
#include "runtime/board_policy.hpp"

namespace abs_hil::program {

namespace {

runtime::RealtimeMode realtime_mode(const std::string& name) {
  if (name == "require") return runtime::RealtimeMode::require;
  return name == "off" ? runtime::RealtimeMode::off : runtime::RealtimeMode::prefer;
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
    for (const config::Change& change : event.changes) {
      throw config::ConfigError(
          fmt::format("{}: [[event]] {}: only a simulated plant can change on command; run experiment {} with "
                      "--backend sim, or leave its events out for the rig",
                      script.at(event.place), change.what, script.name));
    }
    if (!emulated) {
      throw config::ConfigError(
          fmt::format("{}: [[event]] inject: faults are never injected into real hardware; run experiment {} with "
                      "--backend sim, or leave its events out for the rig",
                      script.at(event.place), script.name));
    }
  }
}

/// Refuses profiles of plant parameters, which only a simulated plant can follow.
void refuse_profiles(config::Settings& s) {
  for (const config::ChangingPart& part : config::changing_parts()) {
    if (part.profile(s).empty()) continue;
    throw config::ConfigError(fmt::format(
        "plant.{}_profile: only a simulated plant can follow a profile; leave it out or use --backend sim", part.what));
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

/// The policy of the board, after all settings are known.
void apply_board_policy(config::Settings& s, const config::KeyTable& keys, bool virtual_time) {
  runtime::refuse_unsafe_use({.driver = s.driver,
                              .guarded = s.guardian.enabled,
                              .virtual_time = virtual_time,
                              .rate_Hz = s.control.rate_Hz,
                              .start_speed_rad_s = s.experiment.start_speed_rad_s,
                              .injections = driver::parse_injections(s.inject)});
  runtime::refuse_caps_above_board({.brake = keys.was_set("gate.brake_duty_max") ? s.gate.brake_duty_max : 0.0,
                                    .motor = keys.was_set("gate.motor_duty_max") ? s.gate.motor_duty_max : 0.0},
                                   s.driver);
  runtime::apply_board_limits(s.plant.rig, s.control.rate_Hz, s.gate, s.driver);
}

/// The configuration files of a run, each read once.
struct Files {
  std::vector<config::FileValue> plant{};
  std::vector<config::FileValue> config{};
};

Files read_files(const RunOptions& options, const std::string& default_plant) {
  Files files{.plant = config::read_file(config::plant_file(options.plant.value_or(default_plant)), "plant")};
  if (options.config_file) files.config = config::read_file(*options.config_file);
  return files;
}

/// Everything but what the script asks for beyond its settings.
void fill(config::Settings& s, config::KeyTable& keys, const RunOptions& options, const Files& files,
          const config::Script* script) {
  s.backend = options.backend;
  s.realtime.mode = realtime_mode(options.realtime);
  for (const std::string& assignment : options.defaults) keys.set_text(assignment, "default");
  if (options.plant) s.plant_name = *options.plant;
  config::set_all(files.plant, keys);
  if (script != nullptr) {
    for (const config::Setting& setting : script->settings) {
      keys.set(setting.key, setting.value, script->at(setting.place));
    }
  }
  config::set_all(files.config, keys);

  const auto set = [&keys](const char* key, const std::optional<std::string>& value, const char* option) {
    if (value) keys.set_text(std::string(key) + '=' + *value, option);
  };
  set("control.controller", options.controller, "--controller");
  set("experiment.name", options.experiment, "--experiment");
  set("control.slip_ref", options.slip_ref, "--slip-ref");
  set("control.rate_Hz", options.rate_Hz, "--rate");
  set("run.seed", options.seed, "--seed");
  for (const std::string& assignment : options.assignments) keys.set_text(assignment, "--set");
  for (const std::string& injection : options.injections) s.inject += (s.inject.empty() ? "" : ",") + injection;
  if (options.wait_for_start) keys.set_text("experiment.wait_for_start=true", "--wait-for-start");
}

/// The experiment that options and files name. The settings of its script rank below theirs.
std::shared_ptr<const config::Script> script_of(const RunOptions& options, const Files& files) {
  config::Settings settings;
  config::KeyTable keys(settings);
  fill(settings, keys, options, files, nullptr);
  return config::find(settings.experiment.name);
}

}  // namespace

RunRequest merge(const RunOptions& options) {
  RunRequest request;
  const Files files = read_files(options, request.settings.plant_name);
  request.script = script_of(options, files);
  request.outputs = options.outputs;
  config::Settings& s = request.settings;
  const config::Script& script = *request.script;
  config::KeyTable keys(s);
  fill(s, keys, options, files, &script);
  check_together(request);
  if (s.backend == "rig") {
    refuse_profiles(s);
    refuse_events(script, s.driver.emulated);
  }
  config::apply(script, s);
  static_cast<void>(driver::parse_injections(s.inject));  // in simulation too, a fault is spelled right or refused
  if (s.backend == "rig") apply_board_policy(s, keys, request.outputs.fast);
  nlohmann::ordered_json config = keys.to_json();
  config["experiment_script"] = script.text;
  if (!script.files.empty()) config["experiment_files"] = script.files;
  request.config_json = config.dump();
  request.config_toml = fmt::format(
      "# Effective configuration of a run. To run it again: abs_hil --backend {} --plant {} --config THIS_FILE\n{}",
      s.backend, s.plant_name, keys.to_toml());
  return request;
}

}  // namespace abs_hil::program

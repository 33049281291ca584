#include "program/command_line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/events.hpp"
#include "config/key_table.hpp"
#include "config/library.hpp"
#include "config/plan.hpp"
#include "config/unsafe_settings.hpp"

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

void check_together(const RunRequest& request) {
  const config::Settings& s = request.settings;
  if (s.backend == "rig" && request.outputs.fast && !s.driver.emulated) {
    throw config::ConfigError(
        "--fast: the rig runs in real time only; leave it out, use --backend sim, or, for an emulator in lock-step "
        "(never for hardware), --set driver.emulated=true");
  }
  if (request.outputs.fast && request.outputs.histogram_file) {
    throw config::ConfigError(
        "--histogram: a run in virtual time (--fast) has no latencies to measure; leave out one of the two");
  }
  if (s.backend == "rig" && s.driver.kind == "usb" && !request.outputs.fast &&
      s.driver.usb.answer_timeout_us * s.control.rate_Hz >= 1e6) {
    throw config::ConfigError("driver.usb.answer_timeout_us = " + std::to_string(s.driver.usb.answer_timeout_us) +
                              ": a cycle must not wait longer than its period; give a value below " +
                              std::to_string(std::llround(1e6 / s.control.rate_Hz)) + " or a lower control.rate_Hz");
  }
  if (s.backend == "rig" && s.experiment.start_speed_rad_s > 0.0) {
    throw config::ConfigError(
        "experiment.start_speed_rad_s: a real wheel does not start at speed; leave it out or use --backend sim");
  }
  if (s.experiment.wait_for_start) check_start(request);
  if (s.backend == "rig") refuse_events(*request.script, s.driver.emulated);
  if (s.control.adaptive.theta_min_N >= s.control.adaptive.theta_max_N) {
    throw config::ConfigError("control.adaptive.theta_min_N: give a value below control.adaptive.theta_max_N");
  }
}

/// Applies the board's limits: the gate and the controller's anti-windup must know the outputs that its driver never
/// sends, and the gate's checks of counts need the wheels' encoders.
void apply_board_limits(config::Settings& s) {
  const auto cap = [&s](const auto& board) {
    s.gate.brake_duty_max = std::min(s.gate.brake_duty_max, board.brake_duty_max);
    s.gate.motor_duty_max = std::min(s.gate.motor_duty_max, board.motor_duty_max);
  };
  if (s.driver.kind == "pci") cap(s.driver.pci);
  if (s.driver.kind == "can") cap(s.driver.can);
  if (s.driver.kind == "usb") cap(s.driver.usb);
  s.driver.pci.encoder_counts_per_rev = s.plant.rig.encoder_counts_per_rev;
  s.driver.can.encoder_counts_per_rev = s.plant.rig.encoder_counts_per_rev;
  s.driver.usb.encoder_counts_per_rev = s.plant.rig.encoder_counts_per_rev;
  s.driver.can.rate_Hz = s.control.rate_Hz;
}

/// Fills in all settings, except what the script requests beyond its own settings.
void fill(config::Settings& s, config::KeyTable& keys, const RunOptions& options, const config::Script* script) {
  s.backend = options.backend;
  s.realtime.mode = realtime_mode(options.realtime);
  for (const std::string& assignment : options.defaults) keys.set_text(assignment, "default");
  if (options.plant) s.plant_name = *options.plant;
  config::load_file(config::plant_file(s.plant_name), keys, "plant");
  if (script != nullptr) {
    for (const config::Setting& setting : script->settings) {
      keys.set(setting.key, setting.value, script->at(setting.place));
    }
  }
  if (options.config_file) config::load_file(*options.config_file, keys);

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

/// Finds the experiment script from options and files. The script's settings have lower priority than both.
std::shared_ptr<const config::Script> script_of(const RunOptions& options) {
  config::Settings settings;
  config::KeyTable keys(settings);
  fill(settings, keys, options, nullptr);
  return config::find(settings.experiment.name);
}

}  // namespace

RunRequest merge(const RunOptions& options) {
  RunRequest request;
  request.script = script_of(options);
  request.outputs = options.outputs;
  config::Settings& s = request.settings;
  const config::Script& script = *request.script;
  config::KeyTable keys(s);
  fill(s, keys, options, &script);
  if (s.backend == "rig") refuse_profiles(s);
  check_together(request);
  config::apply(script, s);
  config::refuse_unsafe(s, keys);
  if (s.backend == "rig") apply_board_limits(s);
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

#include "config/live_settings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"

namespace abs_hil::config {

namespace {

constexpr std::string_view slip_ref_key = "control.slip_ref";

/// Where braking begins: without effect once it has.
constexpr std::array<std::string_view, 5> start_values{
    "control.adaptive.zeta0", "control.adaptive_actuator.zeta0", "control.sliding_mode.theta0_N",
    "control.sliding_mode_smooth.theta0_N", "control.super_twisting.theta0_N"};

std::string section_of(std::string controller) {
  std::replace(controller.begin(), controller.end(), '-', '_');
  return "control." + controller + '.';
}

bool may_change(const std::string& key, const std::string& controller) {
  if (key == slip_ref_key) return true;
  if (std::find(start_values.begin(), start_values.end(), key) != start_values.end()) return false;
  // (16) and (17) share these two.
  if (controller == "nominal" && (key == "control.adaptive.ks0" || key == "control.adaptive.ks1")) return true;
  return key.starts_with(section_of(controller));
}

}  // namespace

std::string LiveSettings::resolve(std::string_view name) const {
  Settings copy = settings_;
  const KeyTable keys(copy);
  const std::string& controller = settings_.control.controller;
  for (const std::string& prefix : {std::string(), std::string("control."), section_of(controller)}) {
    std::string key = prefix + std::string(name);
    const auto is_named = [&key](const Key& known) { return known.name == key; };
    if (std::none_of(keys.keys().begin(), keys.keys().end(), is_named)) continue;
    if (may_change(key, controller)) return key;
    throw ConfigError(fmt::format("{} cannot be changed while controller {} runs; what can: control.slip_ref and {}*",
                                  key, controller, section_of(controller)));
  }
  throw ConfigError(fmt::format("no key {} (abs_hil list --keys shows all)", name));
}

experiment::Adjustment LiveSettings::set(const std::string& key, double value) {
  Settings changed = settings_;
  KeyTable(changed).set(key, value, "command");
  experiment::Adjustment adjustment;
  if (key == slip_ref_key) {
    adjustment.kind = experiment::Adjustment::Kind::slip_ref;
    adjustment.slip_ref = changed.control.slip_ref;
  } else {
    adjustment.kind = experiment::Adjustment::Kind::controller;
    const auto make = [](const Settings& s) {
      return control::make_controller(s.control.controller, {s.control, s.plant.rig});
    };
    try {
      adjustment.controller = make(changed);
    } catch (const std::invalid_argument& error) {
      throw ConfigError(fmt::format("{} = {}: {}", key, value, error.what()));
    }
    // Whether the law can do so at all is asked of two that nobody uses.
    if (!make(changed)->take_over(*make(settings_))) {
      throw ConfigError(
          fmt::format("controller {}: its gains cannot be changed while it runs", changed.control.controller));
    }
  }
  settings_ = std::move(changed);
  return adjustment;
}

}  // namespace abs_hil::config

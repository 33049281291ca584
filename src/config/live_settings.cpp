// Which settings may change during a run, and their checked change.
#include "config/live_settings.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"

namespace abs_hil::config {

std::string LiveSettings::resolve(std::string_view name) const {
  Settings copy = settings_;
  const KeyTable keys(copy);
  const std::string& controller = settings_.control.controller;
  for (const std::string& prefix : {std::string(), std::string("control."), control::section_of(controller)}) {
    std::string key = prefix + std::string(name);
    const Key* known = find_key(keys.keys(), key);
    if (known == nullptr) continue;
    if (control::changes_in_a_run(key, *known, controller)) return key;
    throw ConfigError(fmt::format("{} cannot be changed while controller {} runs; change control.slip_ref or {}*", key,
                                  controller, control::section_of(controller)));
  }
  throw ConfigError(fmt::format("unknown key {} (abs_hil list --keys shows all)", name));
}

experiment::Adjustment LiveSettings::set(const std::string& key, double value) {
  Settings changed = settings_;
  KeyTable(changed).set(key, value, "command");
  experiment::Adjustment adjustment;
  if (key == control::slip_ref_key) {
    adjustment.kind = experiment::Adjustment::Kind::slip_ref;
    adjustment.slip_ref = changed.control.slip_ref;
  } else {
    adjustment.kind = experiment::Adjustment::Kind::controller;
    const auto make = [](const Settings& s) {
      return control::make_controller(s.control.controller, {s.control, s.model});
    };
    try {
      adjustment.controller = make(changed);
    } catch (const std::invalid_argument& error) {
      throw ConfigError(fmt::format("{} = {}: {}", key, value, error.what()));
    }
    // Two spare controllers show whether this law can take over at all.
    if (!make(changed)->take_over(*make(settings_))) {
      throw ConfigError(
          fmt::format("the gains of controller {} cannot be changed while it runs; change control.slip_ref only",
                      changed.control.controller));
    }
  }
  settings_ = std::move(changed);
  return adjustment;
}

}  // namespace abs_hil::config

#pragma once

#include <chrono>
#include <string>

#include "config/settings.hpp"

namespace abs_hil::config {

/// Where the model's values come from, in a sentence: "model rig.toml: identified on 2026-11-22, 3 days ago". The date
/// is the line `identified = DATE` that abs_identify writes into a model's file. Throws ConfigError for an unreadable
/// file.
[[nodiscard]] std::string model_origin(const Settings& settings, std::chrono::sys_days today);

}  // namespace abs_hil::config

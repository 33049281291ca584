#pragma once

#include <vector>

#include "config/key_table.hpp"
#include "config/settings.hpp"
#include "driver/injection/injection.hpp"

namespace abs_hil::config {

/// Refuses settings that are within their ranges but unsafe on a rig: faults injected into real hardware, and caps
/// above those of the board that a user has set by name. Throws ConfigError.
/// @param keys the table through which `settings` were set
void refuse_unsafe(const Settings& settings, const KeyTable& keys);

/// The faults to inject. Throws std::invalid_argument, which says what is valid.
[[nodiscard]] std::vector<driver::Injection> injections_of(const Settings& settings);

}  // namespace abs_hil::config

#pragma once

#include <vector>

#include "config/key_table.hpp"
#include "config/settings.hpp"
#include "driver/injection/injection.hpp"

namespace abs_hil::config {

/// Refuses what each key's own range lets through and yet must not reach a rig: faults injected into real hardware, and
/// caps above the board's that somebody set by name. Throws ConfigError.
/// @param keys the table through which `settings` were set
void refuse_unsafe(const Settings& settings, const KeyTable& keys);

/// The faults to inject. Throws std::invalid_argument, saying what is valid.
[[nodiscard]] std::vector<driver::Injection> injections_of(const Settings& settings);

}  // namespace abs_hil::config

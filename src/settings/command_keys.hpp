#pragma once

#include <vector>

#include "abs_hil/settings/key_table.hpp"

namespace abs_hil::settings {

/// Adds everything below `commands.`, and what waits for one.
void add_command_keys(std::vector<Key>& keys, Settings& settings);

}  // namespace abs_hil::settings

#pragma once

#include <vector>

#include "config/key_table.hpp"

namespace abs_hil::config {

/// Adds everything below `commands.`, and what waits for one.
void add_command_keys(std::vector<Key>& keys, Settings& settings);

}  // namespace abs_hil::config

#pragma once

#include <vector>

#include "config/key_table.hpp"
#include "guardian/options.hpp"

namespace abs_hil::config {

/// Adds everything below `guardian.`.
void add_guardian_keys(std::vector<Key>& keys, guardian::GuardianOptions& options);

}  // namespace abs_hil::config

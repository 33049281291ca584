#pragma once

#include <vector>

#include "abs_hil/guardian/options.hpp"
#include "abs_hil/settings/key_table.hpp"

namespace abs_hil::settings {

/// Adds everything below `guardian.`.
void add_guardian_keys(std::vector<Key>& keys, guardian::GuardianOptions& options);

}  // namespace abs_hil::settings

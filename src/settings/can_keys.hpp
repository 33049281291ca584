#pragma once

#include <vector>

#include "abs_hil/driver/can/options.hpp"
#include "abs_hil/settings/key_table.hpp"

namespace abs_hil::settings {

/// Adds everything below `driver.can.`.
void add_can_keys(std::vector<Key>& keys, driver::can::CanOptions& options);

}  // namespace abs_hil::settings

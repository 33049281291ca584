#pragma once

#include <vector>

#include "config/key_table.hpp"
#include "driver/can/options.hpp"

namespace abs_hil::config {

/// Adds everything below `driver.can.`.
void add_can_keys(std::vector<Key>& keys, driver::can::CanOptions& options);

}  // namespace abs_hil::config

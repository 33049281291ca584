#pragma once

#include <vector>

#include "config/key_table.hpp"
#include "driver/factory.hpp"

namespace abs_hil::config {

/// Adds everything below `driver.`.
void add_driver_keys(std::vector<Key>& keys, driver::DriverOptions& options);

}  // namespace abs_hil::config

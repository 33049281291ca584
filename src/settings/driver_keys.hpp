#pragma once

#include <vector>

#include "abs_hil/driver/factory.hpp"
#include "abs_hil/settings/key_table.hpp"

namespace abs_hil::settings {

/// Adds everything below `driver.`.
void add_driver_keys(std::vector<Key>& keys, driver::DriverOptions& options);

}  // namespace abs_hil::settings

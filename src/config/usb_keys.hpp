#pragma once

#include <vector>

#include "config/key_table.hpp"
#include "driver/usb/options.hpp"

namespace abs_hil::config {

/// Adds everything below `driver.usb.`.
void add_usb_keys(std::vector<Key>& keys, driver::usb::UsbOptions& options);

}  // namespace abs_hil::config

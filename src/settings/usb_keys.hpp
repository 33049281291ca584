#pragma once

#include <vector>

#include "abs_hil/driver/usb/options.hpp"
#include "abs_hil/settings/key_table.hpp"

namespace abs_hil::settings {

/// Adds everything below `driver.usb.`.
void add_usb_keys(std::vector<Key>& keys, driver::usb::UsbOptions& options);

}  // namespace abs_hil::settings

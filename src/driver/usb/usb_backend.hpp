#pragma once

#include "abs_hil/driver/backend.hpp"

namespace abs_hil::driver::usb {

/// The registry's entry for driver.kind=usb.
[[nodiscard]] Backend usb_backend();

}  // namespace abs_hil::driver::usb

#pragma once

#include "abs_hil/driver/backend.hpp"

namespace abs_hil::driver::can {

/// The registry's entry for driver.kind=can.
[[nodiscard]] Backend can_backend();

}  // namespace abs_hil::driver::can

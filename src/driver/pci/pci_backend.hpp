#pragma once

#include "abs_hil/driver/backend.hpp"

namespace abs_hil::driver::pci {

/// The registry's entry for driver.kind=pci.
[[nodiscard]] Backend pci_backend();

}  // namespace abs_hil::driver::pci

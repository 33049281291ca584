#pragma once

#include <vector>

#include "abs_hil/driver/backend.hpp"
#include "driver/pci/options.hpp"

namespace abs_hil::driver::pci {

/// The cards that the options do not exclude, with what keeps a run from using them. Accesses no register. Empty if
/// there is no card, or no folder of PCI devices.
[[nodiscard]] std::vector<FoundBoard> survey_cards(const PciOptions& options);

}  // namespace abs_hil::driver::pci

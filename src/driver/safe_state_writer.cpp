#include "abs_hil/driver/safe_state_writer.hpp"

#include "abs_hil/driver/pci/pci_safe_state.hpp"

namespace abs_hil::driver {

std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options) {
  if (options.kind == "pci") return std::make_unique<pci::PciSafeState>(options.pci);
  throw Unavailable("guardian: driver.kind = \"" + options.kind +
                    "\": there is no way yet to make that board safe from a second process");
}

}  // namespace abs_hil::driver

#include "abs_hil/driver/safe_state_writer.hpp"

#include "abs_hil/driver/pci/pci_safe_state.hpp"
#include "abs_hil/driver/take_over_writer.hpp"

namespace abs_hil::driver {

std::unique_ptr<SafeStateWriter> make_safe_state_writer(const DriverOptions& options) {
  if (options.kind == "pci") return std::make_unique<pci::PciSafeState>(options.pci);
  return std::make_unique<TakeOverWriter>([options] { return make_rig_driver(options); });
}

}  // namespace abs_hil::driver

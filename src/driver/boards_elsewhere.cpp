// The boards on platforms that only simulate: in place of the folders can, hm2, pci and usb. Their options are there,
// so that every platform reads every configuration; a driver is not.
#include "abs_hil/driver/backend.hpp"
#include "abs_hil/driver/io_result.hpp"
#include "driver/board_options.hpp"

namespace abs_hil::driver {

namespace {

/// Stands for any function of a row.
template <class Part>
Part refuse(auto&&... /*what it is made from*/) {
  throw Unavailable("--backend rig: only Linux has drivers for boards; run it there, or use --backend sim");
}

template <class Options>
Backend named(std::string_view name) {
  return backend<Options>({.name = name,
                           .summary = "a board; only Linux has its driver",
                           .not_verified = "Only Linux has its driver",
                           .make_driver = refuse<std::unique_ptr<RigDriver>>,
                           .make_safe_state_writer = refuse<std::unique_ptr<SafeStateWriter>>,
                           .outputs = refuse<OutputGrid>});
}

}  // namespace

namespace can {
Backend can_backend() { return named<CanOptions>("can"); }
}  // namespace can
namespace hm2 {
Backend hm2_backend() { return named<Hm2Options>("hm2"); }
}  // namespace hm2
namespace pci {
Backend pci_backend() { return named<PciOptions>("pci"); }
}  // namespace pci
namespace usb {
Backend usb_backend() { return named<UsbOptions>("usb"); }
}  // namespace usb

}  // namespace abs_hil::driver

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "diagnosis/finding.hpp"
#include "driver/usb/options.hpp"
#include "runtime/realtime_setup.hpp"

namespace abs_hil::diagnosis {

/// The checks that `examine` can make, in its order.
[[nodiscard]] std::vector<std::string> check_names();

/// What to examine.
struct Examination {
  std::string only{};  ///< one of check_names(), or empty for all
  std::string lcm_url{};
  runtime::RealtimeOptions realtime{};
  std::string backend{"sim"};
  double rate_Hz{1000.0};                           ///< cycles per second, for the load of a bus
  std::string pci_devices{"/sys/bus/pci/devices"};  ///< where PCI devices are looked for
  driver::usb::UsbOptions usb{};                    ///< which USB devices are boards
  /// Makes the driver of the backend; may throw driver::Unavailable, as may its `configure`.
  std::function<std::unique_ptr<driver::RigDriver>()> make_driver{};
};

/// Looks at this computer. Obtains real time in a thread of its own to see whether it can be had: memory stays locked.
/// Configures the backend's driver, which moves nothing. Only the backend's check can be a failure.
[[nodiscard]] std::vector<Finding> examine(const Examination& examination);

/// Whether the examination turned out well: all checks, if the backend can run; a single one, if nothing in it is to be
/// mended.
[[nodiscard]] bool turned_out_well(const Examination& examination, std::span<const Finding> findings);

}  // namespace abs_hil::diagnosis

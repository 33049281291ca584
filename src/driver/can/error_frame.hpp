#pragma once

#include "driver/can/frame.hpp"

namespace abs_hil::driver::can {

/// What the kernel says about the controller in an error frame. Several may be true at once.
struct BusReport {
  bool bus_off{false};
  bool restarted{false};
  bool error_passive{false};
  bool error_warning{false};
  bool receive_overflow{false};  ///< the controller's own queue
  bool other{false};  ///< bus errors, arbitration, no acknowledgement: counted, they show as losses if lasting
};
[[nodiscard]] BusReport bus_report(const Frame& error_frame) noexcept;

}  // namespace abs_hil::driver::can

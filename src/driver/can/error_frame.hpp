#pragma once

#include "driver/can/frame.hpp"

namespace abs_hil::driver::can {

/// State of the CAN controller, from an error frame of the kernel. Several members may be true at once.
struct BusReport {
  bool bus_off{false};
  bool restarted{false};
  bool error_passive{false};
  bool error_warning{false};
  bool receive_overflow{false};  ///< the controller's own queue
  bool other{false};  ///< bus errors, arbitration, no acknowledgement: only counted; lasting ones show as losses
};
[[nodiscard]] BusReport bus_report(const Frame& error_frame) noexcept;

}  // namespace abs_hil::driver::can

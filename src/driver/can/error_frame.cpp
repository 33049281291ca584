#include "driver/can/error_frame.hpp"

#include <linux/can.h>
#include <linux/can/error.h>

namespace abs_hil::driver::can {

BusReport bus_report(const Frame& error_frame) noexcept {
  const std::uint32_t kind = error_frame.id;
  const unsigned controller = (kind & CAN_ERR_CRTL) != 0 ? error_frame.data[1] : 0U;
  constexpr std::uint32_t told_apart = CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_CRTL;
  return {.bus_off = (kind & CAN_ERR_BUSOFF) != 0,
          .restarted = (kind & CAN_ERR_RESTARTED) != 0,
          .error_passive = (controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0,
          .error_warning = (controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0,
          .receive_overflow = (controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0,
          .other = (kind & ~told_apart) != 0};
}

}  // namespace abs_hil::driver::can

// Keeps the first fault and the first request to stop.
#include "runtime/run_latch.hpp"

namespace abs_hil::runtime {

void RunLatch::keep(rig::Reason reason, double value) noexcept {
  if (rig::is_stop_request(reason)) {
    if (stop_ == rig::Reason::none) stop_ = reason;
    return;
  }
  if (barring_ == rig::Reason::none && !brake_may_hold_after(reason)) barring_ = reason;
  if (fault_ != rig::Reason::none) return;
  fault_ = reason;
  fault_value_ = value;
}

}  // namespace abs_hil::runtime

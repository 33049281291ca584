#pragma once

#include <cstdint>

#include "driver/file_descriptor.hpp"
#include "guardian/guardian_service.hpp"

namespace abs_hil::app {

/// Finds pauses of a virtual machine (QEMU's stop and cont, a migration). All other clocks of the machine stand still
/// meanwhile, so nothing else in it can know; the real-time clock goes on, and its overdue interrupt comes first after
/// the pause. Pauses below about a second stay unseen.
class MachinePause {
 public:
  /// Does nothing on a computer that is not a virtual machine, or has no real-time clock with interrupts.
  MachinePause();
  [[nodiscard]] bool works() const noexcept { return clock_.get() >= 0; }
  /// Use it only if it works. It refers to this object.
  [[nodiscard]] guardian::Interruption interruption();

 private:
  [[nodiscard]] rig::Reason look();
  /// Seconds of the real-time clock; < 0 if it cannot be read.
  [[nodiscard]] std::int64_t clock_s() const;

  driver::FileDescriptor clock_{-1};
  std::int64_t last_clock_s_{-1};
  std::int64_t last_monotonic_ns_{0};
};

}  // namespace abs_hil::app

#pragma once

#include <cstdint>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/reason.hpp"

namespace abs_hil::runtime {

/// What a thread has of the real-time set-up, as the kernel tells it.
struct Scheduling {
  int fifo_priority{0};       ///< SCHED_FIFO priority; 0: another policy
  bool memory_locked{false};  ///< some memory of its process is locked
  /// True if a thread that needs `other` can be supervised from here: neither weaker in the scheduler nor in memory.
  [[nodiscard]] constexpr bool at_least(const Scheduling& other) const noexcept {
    return fifo_priority >= other.fifo_priority && (memory_locked || !other.memory_locked);
  }
};

/// What a cycle learns from its guardian when it beats.
struct GuardianSign {
  /// Why the run must end: `guardian_silent`, or what the guardian takes the outputs back for; `none`: it may drive
  /// them.
  rig::Reason reason{rig::Reason::none};
  std::uint64_t silent_cycles{0};  ///< cycles since the guardian's last sign of life
};

/// The cycle's side of the supervision: the guardian's heartbeat and the flight recorder (guardian/heartbeat.hpp).
/// Real-time safe.
class CycleWatch {
 public:
  CycleWatch() = default;
  CycleWatch(const CycleWatch&) = delete;
  CycleWatch& operator=(const CycleWatch&) = delete;
  virtual ~CycleWatch() = default;

  /// Beats and looks at the guardian. Call it once, at the start of a cycle, before any read or write, so that the
  /// guardian covers that cycle's outputs.
  [[nodiscard]] virtual GuardianSign beat() noexcept = 0;
  virtual void keep(const rig::CycleRecord& record) noexcept = 0;
};

/// Supervisor of a run, such as the guardian. It must be armed before the outputs are enabled, and is told when they
/// are safe again.
class RunGuard : public driver::MakingSafeListener {
 public:
  /// Arms the supervisor; the driver is configured and inactive. Throws driver::Unavailable: the run must not start
  /// then.
  /// @param controller  what the cycle's thread has; a weaker supervisor is refused, because it would act too late
  virtual void arm(const Scheduling& controller) = 0;
  /// Tells that the driver was deactivated. The thread that deactivated it makes the call. Real-time safe.
  /// @param safe  true if the board is known to be in the safe state
  virtual void outputs_released(bool safe) noexcept = 0;
};

}  // namespace abs_hil::runtime

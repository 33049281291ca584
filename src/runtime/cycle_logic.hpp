#pragma once

#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/measurement.hpp"
#include "runtime/run_latch.hpp"

namespace abs_hil::runtime {

/// The middle part of the cycle: estimate, sequence, control. The executive calls it. All functions run in the
/// real-time thread: no allocation, lock, system call, exception or log call.
class CycleLogic {
 public:
  CycleLogic() = default;
  CycleLogic(const CycleLogic&) = delete;
  CycleLogic& operator=(const CycleLogic&) = delete;
  virtual ~CycleLogic() = default;

  /// Tells, before `step`, whether the checks of the wheels are free of doubt about the measurement. While they doubt
  /// it, or a verdict is due, a run does not count as complete.
  virtual void wheels_judged(bool sound) noexcept = 0;
  /// One cycle: takes the measurement, fills `record.phase`, `.reason`, `.reason_value`, `.wheels_apart` and
  /// `.control`, and returns the command wanted. A pure function of measurements and latch so far.
  /// @param latch  asked whether the run must end; faults found here are latched. The brake may hold after a fault
  ///   (`gate.fault_brake_duty`); a further fault that bars it ends this
  [[nodiscard]] virtual rig::Command step(const rig::Measurement& measurement, RunLatch& latch,
                                          rig::CycleRecord& record) noexcept = 0;
  /// Takes the command that the rig now executes: as the driver sent it, after gate, limits and the PWM's steps.
  virtual void commanded(const rig::Command& sent) noexcept = 0;
  /// True if the latest step was the run's last.
  [[nodiscard]] virtual bool finished() const noexcept = 0;
};

}  // namespace abs_hil::runtime

#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/option.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cycle_statistics.hpp"
#include "runtime/heartbeat.hpp"
#include "runtime/spsc_ring.hpp"

namespace abs_hil::runtime {

using RecordRing = SpscRing<rig::CycleRecord>;

/// The middle part of the cycle: estimate, sequence, control. The executive calls it. All functions run in the
/// real-time thread: no allocation, lock, system call, exception or log call.
class CycleLogic {
 public:
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

/// Which late cycles count, and which end the run.
struct OverrunOptions {
  ABS_HIL_OPTIONS(OverrunOptions);
  /// They meet cold caches.
  ABS_HIL_OPTION(std::int32_t, startup_cycles, 10, .meaning = "first cycles of a run, not counted as late or measured",
                 .range = rig::from_zero(100'000), .safety = rig::weaker_above(10));
  ABS_HIL_OPTION(std::int32_t, max_consecutive, 50, .key = "max_consecutive_overruns",
                 .meaning = "late cycles in a row that are a fault; 0: only realtime.late_max_s counts",
                 .range = rig::from_zero(1'000'000), .safety = rig::no_effect_on_safety);
  /// Two late cycles in a row count at least, whatever is set.
  ABS_HIL_OPTION(double, late_max_s, 0.15, .unit = "s",
                 .meaning = "time over which all cycles were late that is a fault", .range = rig::positive(1000),
                 .safety = rig::weaker_above(0.15));
  /// At least three periods count, whatever is set.
  ABS_HIL_OPTION(double, cycle_gap_max_s, 0.0, .unit = "s",
                 .meaning =
                     "longest time from one cycle to the next with an output on, longer is a fault; 0: the "
                     "guardian's time-out, without a guardian 0.1 s",
                 .range = rig::from_zero(10), .safety = rig::weaker_above(0.04));
};

/// Runs the cycle read -> estimate -> sequence -> control -> gate -> write -> record once per period, on absolute
/// ticks, in real or virtual time. After a late cycle it skips whole periods and keeps the ticks' phase; it does not
/// catch up. It blames a late cycle on the part that took longest. Late cycles in a row latch a fault when they are
/// too many or last too long; so do one long gap between two cycles and a suspended computer while an output is on.
/// `step` is real-time safe apart from the clock's sleep and the driver's I/O; the constructor allocates everything.
class CyclicExecutive {
 public:
  /// @param driver active; the executive leaves it active, and its caller must deactivate it
  /// @param period_ns > 0
  /// @param timed  false: keeps no statistics; for a virtual clock, on which every duration is 0 and no cycle is late
  CyclicExecutive(Clock& clock, driver::RigDriver& driver, CycleLogic& logic, CommandGate& gate, RecordRing& ring,
                  std::int64_t period_ns, const OverrunOptions& overruns = {}, bool timed = true);

  /// Sets the time of the first tick; otherwise it is the moment of the first step. Call it before the first step.
  void start_at(std::int64_t first_tick_ns) noexcept { first_tick_ns_ = first_tick_ns; }
  /// Makes each cycle beat, feed the flight recorder, and latch a fault when the guardian is lost. `watch` must
  /// outlive the last step. Call it before the first step.
  void set_watch(Heartbeat& watch) noexcept { watch_ = &watch; }
  /// Sleeps until the next tick and runs one cycle. False after the run's last cycle.
  bool step() noexcept;
  /// Ends the run in order at the next cycle. Any thread or signal handler may call it. The first reason stays.
  void request_stop(rig::Reason reason) noexcept;

  [[nodiscard]] std::int64_t period_ns() const noexcept { return period_ns_; }
  /// Timing statistics; other threads may read them during the run. Only of an executive that keeps them.
  [[nodiscard]] const CycleStatistics& statistics() const noexcept { return *statistics_; }
  /// The driver's first error, for the report; later errors follow from it.
  [[nodiscard]] const driver::IoResult& io_error() const noexcept { return io_error_; }

 private:
  void run_cycle(rig::CycleRecord& record) noexcept;
  void watch_time(std::int64_t woken_ns) noexcept;
  void latch_stale_command(std::int64_t age_ns) noexcept;
  void note_wheels_apart(bool apart) noexcept;
  void keep(const rig::CycleRecord& record) noexcept;
  void schedule_next(const rig::CycleTiming& timing) noexcept;
  void count_late(const rig::CycleTiming& timing, std::int64_t ticks_missed, std::int64_t began_ns,
                  std::int64_t now_ns) noexcept;
  [[nodiscard]] bool starting_up() const noexcept { return sequence_ <= startup_cycles_; }

  Clock& clock_;
  driver::RigDriver& driver_;
  CycleLogic& logic_;
  CommandGate& gate_;
  RecordRing& ring_;
  Heartbeat* watch_{nullptr};
  std::int64_t period_ns_;
  std::uint64_t startup_cycles_;
  std::uint64_t max_consecutive_;
  std::int64_t late_max_ns_;
  std::int64_t late_since_ns_{-1};  ///< the tick of the first of the latest late cycles in a row; < 0: none
  std::int64_t gap_max_ns_;
  bool acting_{false};        ///< the latest command has an output on
  bool wheels_apart_{false};  ///< as the logic told in the latest cycle
  std::int64_t woken_ns_{0};
  SuspensionFinder suspensions_{};
  std::int64_t first_tick_ns_{-1};  ///< < 0: at once
  std::int64_t tick_ns_{0};
  std::int64_t start_ns_{0};
  std::uint64_t sequence_{0};
  std::uint32_t periods_skipped_{0};
  rig::OverrunCause overrun_cause_{rig::OverrunCause::none};
  std::int64_t record_ns_{0};
  std::atomic<rig::Reason> stop_request_{rig::Reason::none};
  rig::Measurement measurement_{};
  driver::IoResult io_error_{};
  std::unique_ptr<CycleStatistics> statistics_;  ///< too large for a stack; null: not timed
};

}  // namespace abs_hil::runtime

#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/rig/option.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cycle_logic.hpp"
#include "runtime/cycle_statistics.hpp"
#include "runtime/heartbeat.hpp"
#include "runtime/spsc_ring.hpp"

namespace abs_hil::runtime {

using RecordRing = SpscRing<rig::CycleRecord>;

/// What counts as late, and when it ends the run.
struct OverrunOptions {
  ABS_HIL_OPTIONS(OverrunOptions);
  /// They meet cold caches.
  ABS_HIL_OPTION(std::int32_t, startup_cycles, 10, .meaning = "first cycles of a run, not counted as late or measured",
                 .range = rig::from_zero(100'000));
  ABS_HIL_OPTION(std::int32_t, max_consecutive, 50, .key = "max_consecutive_overruns",
                 .meaning = "late cycles in a row that are a fault; 0: never", .range = rig::from_zero(1'000'000));
};

/// read -> estimate -> sequence -> control -> gate -> write -> record, once a period on absolute ticks: the same code
/// in real and in virtual time. A cycle that ends late skips whole periods and keeps the phase; it is never caught up
/// with. A late cycle is put down to the part that took longest, and too many in a row latch a fault. `step` is
/// real-time safe apart from the clock's sleep and the driver's I/O; everything is allocated before.
class CyclicExecutive {
 public:
  /// @param driver active, and left active: whoever runs the executive deactivates it
  /// @param period_ns > 0
  CyclicExecutive(Clock& clock, driver::RigDriver& driver, CycleLogic& logic, CommandGate& gate, RecordRing& ring,
                  std::int64_t period_ns, const OverrunOptions& overruns = {});

  /// The first tick, instead of the moment of the first step. Before the first step.
  void start_at(std::int64_t first_tick_ns) noexcept { first_tick_ns_ = first_tick_ns; }
  /// Gives signs of life, keeps records for after a fault, and latches a fault when the guardian is lost. `watch` must
  /// outlive the executive's use. Before the first step.
  void watch_with(Heartbeat& watch) noexcept { watch_ = &watch; }
  /// Sleeps until the next tick and runs one cycle. False after the run's last cycle.
  bool step() noexcept;
  /// Ends the run in an orderly way at the next cycle. Any thread or signal handler may call it; the first reason
  /// stays.
  void request_stop(rig::Reason reason) noexcept;

  /// How it keeps time; other threads may look while it runs.
  [[nodiscard]] const CycleStatistics& statistics() const noexcept { return *statistics_; }
  /// The first error of the driver, for the report: later ones follow from it.
  [[nodiscard]] const driver::IoResult& io_error() const noexcept { return io_error_; }

 private:
  void run_cycle(rig::CycleRecord& record) noexcept;
  void keep(const rig::CycleRecord& record) noexcept;
  void schedule_next(const rig::CycleTiming& timing) noexcept;
  void count_late(const rig::CycleTiming& timing, std::int64_t ticks_missed) noexcept;
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
  std::unique_ptr<CycleStatistics> statistics_;  ///< too large for a stack
};

}  // namespace abs_hil::runtime

#pragma once

#include <atomic>
#include <cstdint>

#include "abs_hil/driver/rig_driver.hpp"
#include "abs_hil/rig/cycle_record.hpp"
#include "abs_hil/runtime/clock.hpp"
#include "abs_hil/runtime/command_gate.hpp"
#include "abs_hil/runtime/cycle_logic.hpp"
#include "abs_hil/runtime/latency_histogram.hpp"
#include "abs_hil/runtime/spsc_ring.hpp"

namespace abs_hil::runtime {

using RecordRing = SpscRing<rig::CycleRecord>;

/// Counters that other threads may read while the executive runs.
struct CycleCounters {
  std::atomic<std::uint64_t> cycles{0};
  std::atomic<std::uint64_t> overruns{0};  ///< cycles that did not end before the next tick
};

/// read -> estimate -> sequence -> control -> gate -> write -> record, once a period on absolute ticks: the same code
/// in real and in virtual time. A cycle that ends late skips whole periods and keeps the phase; it is never caught up
/// with. `step` is real-time safe apart from the clock's sleep and the driver's I/O; everything is allocated before.
class CyclicExecutive {
 public:
  /// @param driver active, and left active: whoever runs the executive deactivates it
  /// @param period_ns > 0
  CyclicExecutive(Clock& clock, driver::RigDriver& driver, CycleLogic& logic, CommandGate& gate, RecordRing& ring,
                  std::int64_t period_ns) noexcept;

  /// Sleeps until the next tick and runs one cycle. False after the run's last cycle.
  bool step() noexcept;
  /// Ends the run in an orderly way at the next cycle. Any thread or signal handler may call it; the first reason
  /// stays.
  void request_stop(rig::Reason reason) noexcept;

  [[nodiscard]] const CycleCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] const LatencyHistogram& wakeup_latency() const noexcept { return wakeup_latency_; }
  [[nodiscard]] const LatencyHistogram& cycle_time() const noexcept { return cycle_time_; }
  /// The last error of the driver, for the report.
  [[nodiscard]] const driver::IoResult& io_error() const noexcept { return io_error_; }

 private:
  void run_cycle(rig::CycleRecord& record) noexcept;
  void schedule_next(rig::CycleRecord& record) noexcept;

  Clock& clock_;
  driver::RigDriver& driver_;
  CycleLogic& logic_;
  CommandGate& gate_;
  RecordRing& ring_;
  std::int64_t period_ns_;
  std::int64_t tick_ns_{0};
  std::int64_t start_ns_{0};
  std::uint64_t sequence_{0};
  std::uint32_t periods_skipped_{0};
  std::atomic<rig::Reason> stop_request_{rig::Reason::none};
  rig::Measurement measurement_{};
  driver::IoResult io_error_{};
  CycleCounters counters_{};
  LatencyHistogram wakeup_latency_{};
  LatencyHistogram cycle_time_{};
};

}  // namespace abs_hil::runtime

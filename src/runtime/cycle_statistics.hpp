#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "abs_hil/rig/cycle_record.hpp"
#include "rig/timing_summary.hpp"
#include "runtime/latency_histogram.hpp"

namespace abs_hil::runtime {

/// Timing statistics of the executive: histograms of every part of the cycle, and counts of late cycles by cause. One
/// thread adds; any thread may read at any time without a lock. The adding functions are real-time safe. Size: 200 kB.
class CycleStatistics {
 public:
  /// Adds the durations of one cycle. Do not call it for start-up cycles.
  void add(const rig::CycleTiming& timing) noexcept;
  void count_cycle() noexcept;
  /// @param ticks_missed whole periods skipped, >= 1
  /// @return how many cycles in a row have now been late
  std::uint64_t count_overrun(rig::OverrunCause cause, std::uint64_t ticks_missed) noexcept;
  void count_startup_overrun() noexcept;
  void count_cycle_in_time() noexcept { run_ = 0; }

  [[nodiscard]] std::uint64_t cycles() const noexcept { return cycles_.load(std::memory_order_relaxed); }
  [[nodiscard]] rig::OverrunCounts overruns() const noexcept;
  [[nodiscard]] rig::TimingSummary summary() const noexcept;

  [[nodiscard]] const LatencyHistogram& wakeup_latency() const noexcept { return wakeup_latency_; }
  [[nodiscard]] const LatencyHistogram& read() const noexcept { return read_; }
  [[nodiscard]] const LatencyHistogram& control() const noexcept { return control_; }
  [[nodiscard]] const LatencyHistogram& write() const noexcept { return write_; }
  [[nodiscard]] const LatencyHistogram& cycle_time() const noexcept { return cycle_time_; }

 private:
  std::atomic<std::uint64_t> cycles_{0};
  std::array<std::atomic<std::uint64_t>, rig::overrun_cause_count> overruns_{};
  std::atomic<std::uint64_t> startup_overruns_{0};
  std::atomic<std::uint64_t> ticks_missed_{0};
  std::atomic<std::uint64_t> longest_run_{0};
  std::uint64_t run_{0};  ///< late cycles in a row; only the adding thread uses it
  LatencyHistogram wakeup_latency_{};
  LatencyHistogram read_{};
  LatencyHistogram control_{};
  LatencyHistogram write_{};
  LatencyHistogram cycle_time_{};
};

}  // namespace abs_hil::runtime

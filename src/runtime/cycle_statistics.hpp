#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

#include "abs_hil/rig/cycle_record.hpp"
#include "rig/timing_summary.hpp"

namespace abs_hil::runtime {

/// Adds to a counter that only one thread writes. A plain load and store is cheaper than a locked read-modify-write.
template <typename Integer>
void add_as_single_writer(std::atomic<Integer>& counter, Integer amount) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + amount, std::memory_order_relaxed);
}

/// Histogram of durations with bins of 1 us and an overflow count. Least, greatest and sum are exact. One thread adds;
/// any thread may read at any time, but may miss the latest few (relaxed atomics). `add` is real-time safe.
class LatencyHistogram {
 public:
  static constexpr std::size_t bins = 10'000;

  /// A negative duration counts as 0.
  void add(std::int64_t duration_ns) noexcept;
  [[nodiscard]] std::uint64_t count() const noexcept { return count_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t overflows() const noexcept { return overflows_.load(std::memory_order_relaxed); }
  /// @param us less than `bins`: durations in [us, us + 1)
  [[nodiscard]] std::uint32_t in_bin(std::size_t us) const noexcept {
    return counts_[us].load(std::memory_order_relaxed);
  }
  /// Least and greatest duration; 0 without any.
  [[nodiscard]] std::int64_t min_ns() const noexcept;
  [[nodiscard]] std::int64_t max_ns() const noexcept { return max_ns_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::int64_t sum_ns() const noexcept { return sum_ns_.load(std::memory_order_relaxed); }
  /// Quantiles, rounded up to the upper edge of their bin. A quantile in the overflow is the maximum.
  [[nodiscard]] rig::DurationQuantiles summary() const noexcept;

 private:
  std::array<std::atomic<std::uint32_t>, bins> counts_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::uint64_t> overflows_{0};
  std::atomic<std::int64_t> min_ns_{INT64_MAX};
  std::atomic<std::int64_t> max_ns_{0};
  std::atomic<std::int64_t> sum_ns_{0};
};

/// Timing statistics of the executive: histograms of every part of the cycle, and counts of late cycles by cause. One
/// thread adds; any thread may read at any time without a lock. The adding functions are real-time safe. Size: 200 kB.
class CycleStatistics {
 public:
  /// Adds the durations of one cycle. Do not call it for start-up cycles.
  void add(const rig::CycleTiming& timing) noexcept;
  void count_cycle() noexcept { add_as_single_writer(cycles_, std::uint64_t{1}); }
  /// @param ticks_missed whole periods skipped, >= 1
  /// @return how many cycles in a row have now been late
  std::uint64_t count_overrun(rig::OverrunCause cause, std::uint64_t ticks_missed) noexcept;
  void count_startup_overrun() noexcept { add_as_single_writer(startup_overruns_, std::uint64_t{1}); }
  void count_cycle_in_time() noexcept { run_ = 0; }

  [[nodiscard]] std::uint64_t cycles() const noexcept { return cycles_.load(std::memory_order_relaxed); }
  [[nodiscard]] rig::OverrunCounts overruns() const noexcept;
  [[nodiscard]] rig::TimingSummary summary() const noexcept;

  /// Of wake-up latency, reading, control, writing and the whole cycle.
  using Parts = std::array<LatencyHistogram, 5>;
  [[nodiscard]] const Parts& parts() const noexcept { return parts_; }

 private:
  std::atomic<std::uint64_t> cycles_{0};
  std::array<std::atomic<std::uint64_t>, rig::overrun_cause_count> overruns_{};
  std::atomic<std::uint64_t> startup_overruns_{0};
  std::atomic<std::uint64_t> ticks_missed_{0};
  std::atomic<std::uint64_t> longest_run_{0};
  std::uint64_t run_{0};  ///< late cycles in a row; only the adding thread uses it
  Parts parts_{};
};

/// The histograms as text in the format of `cyclictest --histogram`, which cyclictest's plotting scripts read. There is
/// one line per microsecond and one column per part of the cycle (in cyclictest: per thread). `#` lines with totals,
/// least, mean, greatest and overflows follow. Columns: wake-up latency, read, control, write, whole cycle. Source:
/// rt-tests 2.4, cyclictest.c, print_hist.
[[nodiscard]] std::string cyclictest_histogram(const CycleStatistics& statistics);

}  // namespace abs_hil::runtime

#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "rig/duration_quantiles.hpp"

namespace abs_hil::runtime {

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

}  // namespace abs_hil::runtime

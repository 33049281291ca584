#include "abs_hil/runtime/latency_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace abs_hil::runtime {

namespace {
constexpr std::int64_t ns_per_us = 1000;

/// Adds one for a single writer: a plain load and store, cheaper than a locked read-modify-write.
template <typename Integer>
void increment(std::atomic<Integer>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}
}  // namespace

void LatencyHistogram::add(std::int64_t duration_ns) noexcept {
  const std::int64_t ns = std::max<std::int64_t>(duration_ns, 0);
  const auto bin = static_cast<std::size_t>(ns / ns_per_us);
  if (bin < bins) {
    increment(counts_[bin]);
  } else {
    increment(overflows_);
  }
  increment(count_);
  if (ns > max_ns()) max_ns_.store(ns, std::memory_order_relaxed);
}

double LatencyHistogram::quantile_us(double fraction) const noexcept {
  const double max_us = static_cast<double>(max_ns()) / static_cast<double>(ns_per_us);
  const auto rank = static_cast<std::uint64_t>(std::ceil(fraction * static_cast<double>(count())));
  std::uint64_t seen = 0;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    seen += in_bin(bin);
    if (seen >= rank) return std::min(static_cast<double>(bin + 1), max_us);
  }
  return max_us;
}

rig::DurationQuantiles LatencyHistogram::summary() const noexcept {
  if (count() == 0) return {};
  return {quantile_us(0.5), quantile_us(0.99), quantile_us(0.999),
          static_cast<double>(max_ns()) / static_cast<double>(ns_per_us)};
}

}  // namespace abs_hil::runtime

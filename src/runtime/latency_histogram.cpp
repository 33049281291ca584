#include "runtime/latency_histogram.hpp"

#include <algorithm>
#include <cmath>

#include "abs_hil/rig/time_units.hpp"
#include "runtime/single_writer.hpp"

namespace abs_hil::runtime {

void LatencyHistogram::add(std::int64_t duration_ns) noexcept {
  const std::int64_t ns = std::max<std::int64_t>(duration_ns, 0);
  const auto bin = static_cast<std::size_t>(ns / rig::ns_per_us);
  if (bin < bins) {
    add_as_single_writer(counts_[bin], std::uint32_t{1});
  } else {
    add_as_single_writer(overflows_, std::uint64_t{1});
  }
  add_as_single_writer(count_, std::uint64_t{1});
  add_as_single_writer(sum_ns_, ns);
  if (ns < min_ns_.load(std::memory_order_relaxed)) min_ns_.store(ns, std::memory_order_relaxed);
  if (ns > max_ns()) max_ns_.store(ns, std::memory_order_relaxed);
}

std::int64_t LatencyHistogram::min_ns() const noexcept {
  return count() == 0 ? 0 : min_ns_.load(std::memory_order_relaxed);
}

rig::DurationQuantiles LatencyHistogram::summary() const noexcept {
  const std::uint64_t total = count();
  if (total == 0) return {};
  const double max_us = rig::in_us(max_ns());
  rig::DurationQuantiles result{max_us, max_us, max_us, max_us};

  struct Wanted {
    double fraction;
    double& value_us;
  };
  const std::array<Wanted, 3> wanted{{{0.5, result.p50_us}, {0.99, result.p99_us}, {0.999, result.p99_9_us}}};
  std::size_t next = 0;
  std::uint64_t seen = 0;
  // Stops at the last quantile: the loop visits only few of the bins.
  for (std::size_t bin = 0; bin < bins && next < wanted.size(); ++bin) {
    seen += in_bin(bin);
    while (next < wanted.size() &&
           static_cast<double>(seen) >= std::ceil(wanted[next].fraction * static_cast<double>(total))) {
      wanted[next++].value_us = std::min(static_cast<double>(bin + 1), max_us);
    }
  }
  return result;
}

}  // namespace abs_hil::runtime

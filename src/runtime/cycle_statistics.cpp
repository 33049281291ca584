// Histograms of latencies and cycle times, as text in cyclictest's format too.
#include "runtime/cycle_statistics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

namespace {

constexpr std::uint64_t one = 1;

using Columns = CycleStatistics::Parts;

/// Index one past the last bin in use, at least 1.
std::size_t bins_in_use(const Columns& columns) {
  std::size_t used = 1;
  for (const LatencyHistogram& column : columns) {
    const auto greatest = static_cast<std::size_t>(column.max_ns() / rig::ns_per_us);
    used = std::max(used, std::min(greatest + 1, LatencyHistogram::bins));
  }
  return used;
}

template <typename Value>
void append_line(std::string& text, const char* title, int digits, const Columns& columns, Value value) {
  text += title;
  for (const LatencyHistogram& column : columns) text += fmt::format(" {:0{}}", value(column), digits);
  text += '\n';
}

}  // namespace

void LatencyHistogram::add(std::int64_t duration_ns) noexcept {
  const std::int64_t ns = std::max<std::int64_t>(duration_ns, 0);
  const auto bin = static_cast<std::size_t>(ns / rig::ns_per_us);
  if (bin < bins) {
    add_as_single_writer(counts_[bin], std::uint32_t{1});
  } else {
    add_as_single_writer(overflows_, one);
  }
  add_as_single_writer(count_, one);
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

void CycleStatistics::add(const rig::CycleTiming& timing) noexcept {
  const std::array durations_ns{timing.wakeup_latency_ns, timing.read_ns, timing.control_ns, timing.write_ns,
                                timing.cycle_ns};
  for (std::size_t i = 0; i < parts_.size(); ++i) parts_[i].add(durations_ns[i]);
}

std::uint64_t CycleStatistics::count_overrun(rig::OverrunCause cause, std::uint64_t ticks_missed) noexcept {
  add_as_single_writer(overruns_[static_cast<std::size_t>(cause)], one);
  add_as_single_writer(ticks_missed_, ticks_missed);
  ++run_;
  if (run_ > longest_run_.load(std::memory_order_relaxed)) longest_run_.store(run_, std::memory_order_relaxed);
  return run_;
}

rig::OverrunCounts CycleStatistics::overruns() const noexcept {
  rig::OverrunCounts counts{.startup = startup_overruns_.load(std::memory_order_relaxed),
                            .ticks_missed = ticks_missed_.load(std::memory_order_relaxed),
                            .longest_run = longest_run_.load(std::memory_order_relaxed)};
  for (std::size_t i = 0; i < counts.by_cause.size(); ++i) {
    counts.by_cause[i] = overruns_[i].load(std::memory_order_relaxed);
    counts.total += counts.by_cause[i];
  }
  return counts;
}

rig::TimingSummary CycleStatistics::summary() const noexcept {
  return {.wakeup_latency = parts_[0].summary(),
          .read = parts_[1].summary(),
          .control = parts_[2].summary(),
          .write = parts_[3].summary(),
          .cycle_time = parts_[4].summary(),
          .overruns = overruns()};
}

std::string cyclictest_histogram(const CycleStatistics& statistics) {
  const Columns& columns = statistics.parts();
  std::string text =
      "# abs_hil, us; columns: wake-up latency, read, control, write, whole cycle\n"
      "# Histogram\n";
  const std::size_t used = bins_in_use(columns);
  for (std::size_t bin = 0; bin < used; ++bin) {
    text += fmt::format("{:06} {:06}\t{:06}\t{:06}\t{:06}\t{:06}\n", bin, columns[0].in_bin(bin),
                        columns[1].in_bin(bin), columns[2].in_bin(bin), columns[3].in_bin(bin), columns[4].in_bin(bin));
  }
  using Histogram = const LatencyHistogram&;
  const auto us = [](std::int64_t ns) { return static_cast<std::uint64_t>(ns / rig::ns_per_us); };
  append_line(text, "# Total:", 9, columns, [](Histogram h) { return h.count() - h.overflows(); });
  append_line(text, "# Min Latencies:", 5, columns, [us](Histogram h) { return us(h.min_ns()); });
  append_line(text, "# Avg Latencies:", 5, columns,
              [us](Histogram h) { return h.count() == 0 ? 0 : us(h.sum_ns() / static_cast<std::int64_t>(h.count())); });
  append_line(text, "# Max Latencies:", 5, columns, [us](Histogram h) { return us(h.max_ns()); });
  append_line(text, "# Histogram Overflows:", 5, columns, [](Histogram h) { return h.overflows(); });
  return text;
}

}  // namespace abs_hil::runtime

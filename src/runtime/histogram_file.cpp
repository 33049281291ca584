#include "runtime/histogram_file.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::runtime {

namespace {

using Columns = std::array<const LatencyHistogram*, 5>;

/// Index one past the last bin in use, at least 1.
std::size_t bins_in_use(const Columns& columns) {
  std::size_t used = 1;
  for (const LatencyHistogram* column : columns) {
    const auto greatest = static_cast<std::size_t>(column->max_ns() / rig::ns_per_us);
    used = std::max(used, std::min(greatest + 1, LatencyHistogram::bins));
  }
  return used;
}

void append_number(std::string& text, const char* format, unsigned long long value) {
  std::array<char, 32> digits{};
  std::snprintf(digits.data(), digits.size(), format, value);
  text += digits.data();
}

template <typename Value>
void append_line(std::string& text, const char* title, const char* format, const Columns& columns, Value value) {
  text += title;
  for (const LatencyHistogram* column : columns) append_number(text, format, value(*column));
  text += '\n';
}

}  // namespace

std::string cyclictest_histogram(const CycleStatistics& statistics) {
  const Columns columns{&statistics.wakeup_latency(), &statistics.read(), &statistics.control(), &statistics.write(),
                        &statistics.cycle_time()};
  std::string text =
      "# abs_hil, us; columns: wake-up latency, read, control, write, whole cycle\n"
      "# Histogram\n";
  const std::size_t used = bins_in_use(columns);
  for (std::size_t bin = 0; bin < used; ++bin) {
    append_number(text, "%06llu", bin);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      append_number(text, i == 0 ? " %06llu" : "\t%06llu", columns[i]->in_bin(bin));
    }
    text += '\n';
  }
  using Histogram = const LatencyHistogram&;
  const auto us = [](std::int64_t ns) { return static_cast<unsigned long long>(ns / rig::ns_per_us); };
  append_line(text, "# Total:", " %09llu", columns, [](Histogram h) { return h.count() - h.overflows(); });
  append_line(text, "# Min Latencies:", " %05llu", columns, [us](Histogram h) { return us(h.min_ns()); });
  append_line(text, "# Avg Latencies:", " %05llu", columns,
              [us](Histogram h) { return h.count() == 0 ? 0 : us(h.sum_ns() / static_cast<std::int64_t>(h.count())); });
  append_line(text, "# Max Latencies:", " %05llu", columns, [us](Histogram h) { return us(h.max_ns()); });
  append_line(text, "# Histogram Overflows:", " %05llu", columns, [](Histogram h) { return h.overflows(); });
  return text;
}

}  // namespace abs_hil::runtime

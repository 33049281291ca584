#pragma once

#include <string>

#include "runtime/cycle_statistics.hpp"

namespace abs_hil::runtime {

/// The histograms as text in the format of `cyclictest --histogram`, which cyclictest's plotting scripts read. There is
/// one line per microsecond and one column per part of the cycle (in cyclictest: per thread). `#` lines with totals,
/// least, mean, greatest and overflows follow. Columns: wake-up latency, read, control, write, whole cycle. Source:
/// rt-tests 2.4, cyclictest.c, print_hist.
[[nodiscard]] std::string cyclictest_histogram(const CycleStatistics& statistics);

}  // namespace abs_hil::runtime

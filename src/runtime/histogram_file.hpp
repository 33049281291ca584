#pragma once

#include <filesystem>
#include <string>

#include "runtime/cycle_statistics.hpp"

namespace abs_hil::runtime {

/// The histograms as text in the format of `cyclictest --histogram`, which cyclictest's plotting scripts read. There is
/// one line per microsecond and one column per part of the cycle (in cyclictest: per thread). `#` lines with totals,
/// least, mean, greatest and overflows follow. Columns: wake-up latency, read, control, write, whole cycle. Source:
/// rt-tests 2.4, cyclictest.c, print_hist.
[[nodiscard]] std::string cyclictest_histogram(const CycleStatistics& statistics);

/// The histogram file. It is opened before the run, so that a bad path fails before anything moves.
class HistogramFile {
 public:
  /// Throws std::runtime_error, naming path, reason and fix, if the file cannot be written.
  explicit HistogramFile(std::filesystem::path path);
  /// Throws std::runtime_error if the file cannot be written.
  void write(const CycleStatistics& statistics);

 private:
  std::filesystem::path path_;
};

}  // namespace abs_hil::runtime

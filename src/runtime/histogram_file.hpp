#pragma once

#include <filesystem>
#include <string>

#include "runtime/cycle_statistics.hpp"

namespace abs_hil::runtime {

/// The histograms in the format of `cyclictest --histogram`, which its plotting scripts read: one line for each
/// microsecond, one column for each part of the cycle (cyclictest: for each thread), then `#` lines with totals, least,
/// mean, greatest and overflows. Columns: wake-up latency, read, control, write, whole cycle. Source: rt-tests 2.4,
/// cyclictest.c, print_hist.
[[nodiscard]] std::string cyclictest_histogram(const CycleStatistics& statistics);

/// A file for that, opened before the run so that a bad path is known before anything moves.
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

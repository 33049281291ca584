#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "replay/rerun.hpp"

namespace abs_hil::replay {

/// Result of `abs_hil replay --check`.
struct CheckResult {
  bool equal{true};
  std::vector<std::string> lines{};  ///< each comparison and its result, as text
};

/// Runs the recorded configuration again and compares bit by bit:
/// - open loop, always: the recorded measurements must give the same estimates, phases, reasons and commands;
/// - simulation, if the recording determines the start of the run: the recorded seed and times must also give the same
///   encoder counts and true motion; for a run with --fast every telemetry message is compared byte by byte.
[[nodiscard]] CheckResult check(const RecordedRun& run);

/// The first field in which two messages differ in their bits; empty if there is none.
struct Difference {
  std::string field;
  std::string recorded;
  std::string computed;
};
/// @param with_timing  false: does not compare durations, which no rerun can repeat
[[nodiscard]] Difference first_difference(const telemetry_t& recorded, const telemetry_t& computed, bool with_timing);

}  // namespace abs_hil::replay

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "replay/rerun.hpp"

namespace abs_hil::replay {

/// What `abs_hil replay --check` found.
struct CheckResult {
  bool equal{true};
  std::vector<std::string> lines{};  ///< what was compared and what came of it, for people
};

/// Runs the recorded configuration again and compares bit by bit:
/// - open loop, always: from the recorded measurements the same estimates, phases, reasons and commands;
/// - simulation, where the run was one whose start the recording tells: from the recorded seed and times the same
///   encoder counts and true motion as well; of a run with --fast every telemetry message byte by byte.
[[nodiscard]] CheckResult check(const RecordedRun& run);

/// The first field in which a message differs from another, by its bits; empty if there is none.
struct Difference {
  std::string field;
  std::string recorded;
  std::string computed;
};
/// @param with_timing  false: durations, which no rerun can repeat, are not compared
[[nodiscard]] Difference first_difference(const telemetry_t& recorded, const telemetry_t& computed, bool with_timing);

}  // namespace abs_hil::replay

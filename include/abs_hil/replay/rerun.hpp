#pragma once

#include <cstdint>
#include <vector>

#include "abs_hil/replay/recorded_run.hpp"
#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::replay {

/// A cycle computed anew.
struct RerunCycle {
  rig::CycleRecord record{};
  double distance_m{0.0};
};

/// Feeds the recorded measurements, at their recorded times, through estimators, sequence, controller and gate of
/// `settings`: what they would have commanded, had it changed nothing about how the rig moved. The brake model is
/// driven by the recorded commands, which are those that acted. Ends where the recording or the new sequence ends. What
/// came from outside of the cycle (signals, stop, I/O errors, late cycles) ends it in the recorded cycle.
[[nodiscard]] std::vector<RerunCycle> rerun_open_loop(const RecordedRun& run, const settings::Settings& settings);

/// The same cycle at the recorded times with the simulated rig of `settings`, from the recorded seed on.
[[nodiscard]] std::vector<RerunCycle> rerun_simulation(const RecordedRun& run, const settings::Settings& settings);

/// True for a cycle that ended the run for a reason that a rerun cannot find by itself and takes from the recording.
[[nodiscard]] bool ended_from_outside(const telemetry_t& cycle) noexcept;

}  // namespace abs_hil::replay

#pragma once

#include <cstdint>
#include <vector>

#include "abs_hil/rig/cycle_record.hpp"
#include "replay/recorded_run.hpp"

namespace abs_hil::replay {

/// A cycle computed anew.
struct RerunCycle {
  rig::CycleRecord record{};
  double distance_m{0.0};
};

/// Where the gate's findings about the wheels (reasons 130 to 142) come from in a rerun.
enum class WheelFaults : std::uint8_t {
  found_again,  ///< by the run's own gate, from the recorded counts and the commands of the rerun, which must be those
                ///< that acted: for the configuration of the recording alone
  as_recorded   ///< they end the rerun in the recorded cycle
};

/// Feeds the recorded measurements, at their recorded times, through estimators, sequence, controller and gate of
/// `settings`: what they would have commanded, had it changed nothing about how the rig moved. The brake model is
/// driven by the recorded commands, which are those that acted. Ends where the recording or the new sequence ends. What
/// came from outside of the cycle (signals, stop, I/O errors, late cycles) ends it in the recorded cycle.
[[nodiscard]] std::vector<RerunCycle> rerun_open_loop(const RecordedRun& run, const config::Settings& settings,
                                                      WheelFaults faults);

/// The same cycle at the recorded times with the simulated rig of `settings`, from the recorded seed on. Faults of the
/// wheels are found again.
[[nodiscard]] std::vector<RerunCycle> rerun_simulation(const RecordedRun& run, const config::Settings& settings);

/// True if in cycle `n` the run came, or began to come, to an end for a reason that a rerun cannot find by itself and
/// takes from the recording.
[[nodiscard]] bool ended_from_outside(const RecordedRun& run, std::size_t n, WheelFaults faults) noexcept;

}  // namespace abs_hil::replay

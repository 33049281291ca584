#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"
#include "analysis/run_metrics.hpp"
#include "run/run.hpp"

namespace abs_hil::study {

/// Result of a simulated run.
struct RunResult {
  analysis::Metrics metrics{};
  rig::Reason fault{rig::Reason::none};  ///< reason of an early end; the metrics then cover the run up to it
  [[nodiscard]] bool stopped() const noexcept { return fault == rig::Reason::none; }
};

/// Runs one experiment in virtual time in the calling thread, through the program's own cycle, until its metrics are
/// complete. It leaves out the hold phase after braking. The result depends on the arguments alone, not on the thread.
/// @param plant  the true parameters of the rig
/// @param seed  seed of the simulator: the encoders' initial position within a count
/// Throws std::invalid_argument for unusable options.
[[nodiscard]] RunResult simulate(const run::Prepared& prepared, const plant_sim::PlantOptions& plant,
                                 std::uint64_t seed);

}  // namespace abs_hil::study

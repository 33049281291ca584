#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"
#include "analysis/run_metrics.hpp"
#include "config/settings.hpp"

namespace abs_hil::study {

/// What a simulated run came to.
struct RunResult {
  analysis::Metrics metrics{};
  rig::Reason fault{rig::Reason::none};  ///< what ended it early; its figures then hold up to there
  [[nodiscard]] bool stopped() const noexcept { return fault == rig::Reason::none; }
};

/// Runs one experiment in virtual time in the calling thread, through the program's own cycle, until its metrics are
/// complete: the hold to standstill after braking is left out. A function of its arguments alone, whatever the thread.
/// @param settings what controller and sequence are made of; `settings.plant` is the rig as the controller knows it
/// @param plant the rig as it is
/// @param seed of the simulator: where within a count the encoders start
/// Throws std::invalid_argument for unusable options.
[[nodiscard]] RunResult simulate(const config::Settings& settings, const plant_sim::PlantOptions& plant,
                                 std::uint64_t seed);

}  // namespace abs_hil::study

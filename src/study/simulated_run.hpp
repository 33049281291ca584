#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"
#include "analysis/run_metrics.hpp"
#include "config/plan.hpp"
#include "config/settings.hpp"

namespace abs_hil::study {

/// Result of a simulated run.
struct RunResult {
  analysis::Metrics metrics{};
  rig::Reason fault{rig::Reason::none};  ///< reason of an early end; the metrics then cover the run up to it
  [[nodiscard]] bool stopped() const noexcept { return fault == rig::Reason::none; }
};

/// What runs with the same settings have in common, prepared once.
struct PreparedSettings {
  /// Throws config::ConfigError for an experiment that these settings cannot run.
  /// @param s  settings of controller and sequence; `s.model` is the rig as the controller knows it. They must outlive
  ///   this object.
  PreparedSettings(const config::Settings& s);  // NOLINT(google-explicit-constructor): a run needs no more

  const config::Settings& settings;
  config::Plan plan;
  bool to_stop;  ///< the experiment means to brake to a stop
};

/// Runs one experiment in virtual time in the calling thread, through the program's own cycle, until its metrics are
/// complete. It leaves out the hold phase after braking. The result depends on the arguments alone, not on the thread.
/// @param plant  the true parameters of the rig
/// @param seed  seed of the simulator: the encoders' initial position within a count
/// Throws std::invalid_argument for unusable options.
[[nodiscard]] RunResult simulate(const PreparedSettings& prepared, const plant_sim::PlantOptions& plant,
                                 std::uint64_t seed);

}  // namespace abs_hil::study

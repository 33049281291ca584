#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/rig/range.hpp"
#include "config/settings.hpp"
#include "study/simulated_run.hpp"
#include "study/variation.hpp"

namespace abs_hil::study {

/// One configuration value that the search may set.
struct TunedKey {
  std::string name;  ///< dotted, as for --set
  rig::SearchRange search;
};

/// The gains of a controller that the search sets: those of its options whose rows give a range for it. Empty for a
/// controller without them. The speed observer, which all share, is not among them.
[[nodiscard]] std::vector<TunedKey> tuned_keys(std::string_view controller);
/// False for five-phase, which neither measures slip nor has a reference for it.
[[nodiscard]] bool follows_slip_reference(std::string_view controller) noexcept;
/// The controllers that have such keys.
[[nodiscard]] std::vector<std::string_view> tunable_controllers();

/// What a run is charged: the smaller, the better. With the stop distance D of the run and that of a locked wheel on
/// the same plant D_locked,
///   D / D_locked + 2 slip RMS error + 0.2 slip overshoot + 0.5/s time locked + 1e-4 (torque variation / largest
///   torque),
/// without the two terms of slip for controllers that follow no reference, or 3 for a run that a fault ends. 1 % of
/// D_locked weighs as much as 0.005 of slip RMS error, 0.05 of overshoot, 20 ms of a locked wheel or 100 full brake
/// strokes. Slip must weigh this much: with the paper's reference of 0.15, far past the peak of friction at 0.05, a
/// controller that does not do as it is told would otherwise win by stopping sooner.
[[nodiscard]] double run_cost(const RunResult& run, bool follows_slip, double locked_distance_m,
                              double max_torque_Nm) noexcept;

/// The plants on which gains are judged.
struct TrainingSet {
  std::vector<config::Settings> plants{};  ///< one effective configuration for each nominal plant
  std::size_t cases_per_plant{6};
  /// Of the perturbations. A series of its own: no evaluation uses it (`compare` starts from 1).
  std::uint64_t seed{20'150'401};
  Variation variation{Variation::standard()};
};

/// Differential evolution (Storn and Price 1997), rand-to-best/1/bin with reflection at the bounds: needs no
/// derivatives, and each generation is evaluated at once, so that the result does not depend on the number of threads.
struct SearchOptions {
  std::size_t generations{24};
  std::size_t population{0};  ///< 0: 8 for each gain, at least 16 and at most 40
  double weight{0.7};         ///< F
  double crossover{0.9};      ///< CR
  std::uint64_t seed{1};
  std::size_t threads{1};
};

struct TuningResult {
  std::vector<double> values{};  ///< one for each key, rounded to three digits
  double cost{0.0};              ///< of these rounded values, mean over the training set
  double start_cost{0.0};        ///< of the gains in `training.plants`, for comparison
  std::size_t evaluations{0};
};

/// Searches for the gains of `controller`. What they are in `training.plants` has no influence.
/// @param progress called after each generation with its number and the best cost
/// Throws std::invalid_argument for a controller without keys to tune or an empty training set.
[[nodiscard]] TuningResult tune(std::string_view controller, const TrainingSet& training, const SearchOptions& search,
                                const std::function<void(std::size_t, double)>& progress = {});

/// A configuration file (for --config) that sets these values.
[[nodiscard]] std::string to_toml(std::string_view controller, const TuningResult& result, std::string_view comment);

}  // namespace abs_hil::study

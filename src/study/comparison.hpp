#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "config/settings.hpp"
#include "study/simulated_run.hpp"
#include "study/variation.hpp"

namespace abs_hil::study {

/// What is compared, and over what.
struct ComparisonPlan {
  config::Settings settings{};  ///< of every run; `control.controller` is set to each of `controllers` in turn
  std::vector<std::string> controllers{};
  std::size_t repeat{1};  ///< runs of each controller, >= 1
  std::uint64_t seed{1};  ///< of the series of perturbations
  Variation variation{Variation::standard()};
  std::size_t threads{1};
};

/// The runs of each controller, all over the same series of plants.
struct Comparison {
  /// results[c][k]: controller c on perturbation k
  std::vector<std::vector<RunResult>> results{};
};

/// Runs all controllers over the same perturbed plants: perturbation k depends on (seed, k) alone, so every controller
/// meets the same plants and sensors, and the result is the same with any number of threads.
/// @param done called after each run with the number of runs finished so far, from several threads
/// Throws std::invalid_argument for an unknown or repeated controller, no run at all, or unusable options, before any
/// run.
[[nodiscard]] Comparison compare(const ComparisonPlan& plan, const std::function<void(std::size_t)>& done = {});

}  // namespace abs_hil::study

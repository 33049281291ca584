// Controllers side by side: a study of one case, its runs by controller.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "config/settings.hpp"
#include "study/contender.hpp"
#include "study/simulated_run.hpp"
#include "study/study.hpp"
#include "study/variation.hpp"

namespace abs_hil::study {

/// Plan of a comparison.
struct ComparisonPlan {
  config::Settings settings{};             ///< common settings of all runs
  std::vector<std::string> controllers{};  ///< each as read_contender reads it; the first is the baseline
  std::size_t repeat{1};                   ///< runs of each controller, >= 1
  std::uint64_t seed{1};                   ///< seed of the perturbations
  Variation variation{Variation::standard()};
  std::size_t threads{1};
};

/// The plan as a study of one case: run k * controllers + c is controller c on perturbation k. Throws
/// std::invalid_argument and config::ConfigError as `contenders_of`, and for zero runs and unusable options.
[[nodiscard]] Study study_of(const ComparisonPlan& plan);

/// The controllers of a plan with their settings. Throws std::invalid_argument and config::ConfigError for an unknown
/// or repeated one, for none, and for unusable options.
[[nodiscard]] std::vector<Contender> contenders_of(const ComparisonPlan& plan);

/// The runs of all controllers over the same perturbed plants.
struct Comparison {
  /// results[c][k]: controller c on perturbation k
  std::vector<std::vector<RunResult>> results{};
  std::vector<Contender> contenders{};
};

/// Runs all controllers over the same perturbed plants. Perturbation k depends on (seed, k) alone, so every controller
/// gets the same plants and sensors, and the number of threads does not change the result.
/// @param done  called after each run, from several threads, with the number of finished runs
/// Before any run, throws std::invalid_argument for an unknown or repeated controller, zero runs, or unusable options.
[[nodiscard]] Comparison compare(const ComparisonPlan& plan, const std::function<void(std::size_t)>& done = {});

}  // namespace abs_hil::study

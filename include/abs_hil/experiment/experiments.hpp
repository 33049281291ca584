#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "abs_hil/experiment/options.hpp"
#include "abs_hil/experiment/sequence.hpp"

namespace abs_hil::experiment {

struct ExperimentEntry {
  std::string_view name;
  std::string_view summary;
  /// @param v_min_m_s least car speed for slip control
  std::vector<PhasePlan> (*plan)(const ExperimentOptions& options, double v_min_m_s);
  /// Friction of the simulated road, as plant.friction_profile, that the experiment is about; empty: none.
  std::string_view friction_profile{};
};

/// The experiments that `--experiment` knows by name.
[[nodiscard]] std::span<const ExperimentEntry> experiments() noexcept;

/// The simulated road that the experiment of that name is about (ExperimentEntry); empty for an unknown name.
[[nodiscard]] std::string_view friction_profile_of(std::string_view experiment) noexcept;

/// The phases of `options.name`. Throws std::invalid_argument, naming the known ones, for an unknown name.
[[nodiscard]] std::vector<PhasePlan> plan_experiment(const ExperimentOptions& options, double v_min_m_s);

}  // namespace abs_hil::experiment

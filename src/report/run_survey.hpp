#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "analysis/run_metrics.hpp"
#include "report/run_files.hpp"

namespace abs_hil::report {

struct PhaseInterval {
  std::string phase{};
  double from_s{0.0};
  double to_s{0.0};
};

/// A change of the simulated rig during the run.
struct PlantChange {
  double time_s{0.0};   ///< since the start of the run
  std::string label{};  ///< plain text: "friction × 0.5"; "friction drifts" at the start of a slope
};

/// Results of a first pass over a run's rows.
struct RunSurvey {
  std::size_t rows{0};
  double from_s{0.0};
  double to_s{0.0};
  std::vector<PhaseInterval> phases{};                            ///< in order; at most `most_phases`
  double brake_from_s{std::numeric_limits<double>::quiet_NaN()};  ///< start of the first braking; NaN if there is none
  double brake_to_s{std::numeric_limits<double>::quiet_NaN()};    ///< end of the last braking
  std::vector<PlantChange> plant_changes{};  ///< from the configuration; only those that the run reached
  bool truncated{false};                     ///< the file ends within a row
  std::vector<std::string> known_columns{};  ///< columns with at least one number
  std::vector<std::string> signals{};        ///< known columns of the controller's own signals
  analysis::Metrics metrics{};               ///< computed from the rows
  double r2_m{0.0};                          ///< lower wheel's radius used for them

  [[nodiscard]] bool knows(std::string_view column) const;
  [[nodiscard]] bool brakes() const { return brake_from_s == brake_from_s; }
};

/// At most this many phases are kept; a run has a handful.
inline constexpr std::size_t most_phases = 2000;

/// Reads a run's CSV once, in constant memory. Throws InputError.
[[nodiscard]] RunSurvey survey(const RunFiles& run);

}  // namespace abs_hil::report

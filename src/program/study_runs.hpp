// A study as the program runs it, and single runs of it with everything recorded.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "program/command_line.hpp"
#include "study/study.hpp"
#include "study/variation.hpp"

namespace abs_hil::program {

/// The paper brakes from 1625 rpm, 170 rad/s. Simulated studies begin there unless the configuration says otherwise.
inline constexpr double study_start_speed_rad_s = 170.0;

/// The options of a run that give the settings of a case, before controller and factors.
[[nodiscard]] RunOptions options_of_case(const study::StudyScript& script, const std::string& plant,
                                         const std::string& experiment);

/// The study with its plants and experiments looked up. Throws config::ConfigError and std::invalid_argument.
[[nodiscard]] study::Study make_study(study::StudyScript script);

/// The study's own metrics of one run, from its records; the run goes on to the end of its experiment.
[[nodiscard]] std::vector<double> own_metrics(const study::Study& study, std::uint64_t number);

/// Throws config::ConfigError unless the study has a run of this number.
void require_run(const study::Study& study, std::uint64_t number);

/// The options that repeat one run of a study, the hold phase after braking included.
/// Throws config::ConfigError unless the study has a run of this number.
[[nodiscard]] RunOptions options_of_run(const study::Study& study, std::uint64_t number);

/// The options that make the run on one varied plant of `abs_hil compare` of these options. The model stays.
/// @param index  of the plant, from 0
/// Throws what `merge` throws.
[[nodiscard]] RunOptions on_varied_plant(RunOptions options, const study::Variation& variation, std::uint64_t seed,
                                         std::uint64_t index);

/// Repeats one run of a study with everything recorded in a run folder, as `abs_hil --fast --out FOLDER` does: from the
/// beginning to the end of its experiment. Its config.toml repeats it once more. Returns the run's exit status.
/// @param number  of a run that the study has
/// @param options  that gave the settings of the run's case
/// @param folder  new or empty; none: a new one below the folder of runs
/// Throws what `run` throws.
int record_run(const study::Study& study, std::uint64_t number, RunOptions options,
               const std::optional<std::string>& folder, const std::vector<std::string>& command_line);

}  // namespace abs_hil::program

// A study as the program runs it: its plants and experiments looked up, and single runs of it with everything recorded.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "program/command_line.hpp"
#include "study/compute.hpp"
#include "study/study.hpp"

namespace abs_hil::program {

/// The paper brakes from 1625 rpm, 170 rad/s. Simulated studies begin there unless the configuration says otherwise.
inline constexpr double study_start_speed_rad_s = 170.0;

/// The study with its plants and experiments looked up. Throws config::ConfigError and std::invalid_argument.
[[nodiscard]] study::Study make_study(study::StudyScript script);

/// Computes what the folder lacks of a shard. Puts the results together if the shard is the whole study.
/// @param threads  0: one for each processor
study::Tally compute_study(const study::Study& study, const study::StudyFolder& folder, const study::Shard& shard,
                           std::size_t threads, const study::Progress& progress);

/// The settings of one run of a study, its varied plant included.
/// Throws config::ConfigError unless the study has a run of this number.
[[nodiscard]] config::Settings settings_of_run(const study::Study& study, std::uint64_t number);

/// Repeats one run of a study with everything recorded in a run folder, as `abs_hil --fast --out FOLDER` does: from the
/// beginning to the end of its experiment. Its config.toml repeats it once more. Returns the run's exit status.
/// @param folder  new or empty; none: a new one below the folder of runs
/// Throws config::ConfigError unless the study has a run of this number, and what `run` throws.
int record_run(const study::Study& study, std::uint64_t number, const std::optional<std::string>& folder,
               const std::vector<std::string>& command_line);

}  // namespace abs_hil::program

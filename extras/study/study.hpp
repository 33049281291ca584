// A study ready to run: which runs it has and what each is made of.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "config/settings.hpp"
#include "study/design.hpp"
#include "study/study_script.hpp"

namespace abs_hil::study {

/// A plant with an experiment, and the settings that they and the study's [settings] give.
struct StudyCase {
  std::string plant{};
  std::string experiment{};
  config::Settings settings{};
};

/// Which run of a study. Runs are numbered from 0; the controller changes fastest, then repetition, point, the levels
/// of the factors (the last one in the file first), experiment and plant.
struct RunIndex {
  std::size_t study_case{0};
  std::uint64_t levels{0};  ///< number of the combination of levels
  std::uint64_t point{0};   ///< of the design
  std::uint64_t repetition{0};
  std::size_t contender{0};

  /// True if both runs have the same settings: they differ at most in their varied plant.
  [[nodiscard]] bool same_settings(const RunIndex& other) const noexcept {
    return study_case == other.study_case && levels == other.levels && point == other.point &&
           contender == other.contender;
  }
};

/// The columns of a study's results: number of the run, what it is made of, how it ended, its metrics.
[[nodiscard]] std::vector<std::string> result_columns(const StudyScript& script);

/// A study ready to run. What run number k is depends on the study and k alone. Immutable, so thread-safe.
class Study {
 public:
  /// @param cases  plants outermost; not empty. Throws config::ConfigError and std::invalid_argument for an unknown or
  ///   repeated controller, unusable options, and more runs than can be numbered.
  Study(StudyScript script, std::vector<StudyCase> cases);

  [[nodiscard]] const StudyScript& script() const noexcept { return script_; }
  [[nodiscard]] const std::vector<StudyCase>& cases() const noexcept { return cases_; }
  /// The controllers of a case, with the settings of the case.
  [[nodiscard]] const std::vector<Contender>& contenders(std::size_t study_case) const {
    return contenders_[study_case];
  }
  [[nodiscard]] std::uint64_t runs() const noexcept { return runs_; }

  /// @param run  < runs()
  [[nodiscard]] RunIndex index_of(std::uint64_t run) const noexcept;
  /// The value of a factor in a run. @param factor  index into script().factors
  [[nodiscard]] config::Value value_of(const RunIndex& index, std::size_t factor) const;
  /// True if all runs of a controller and case can share its settings: only numbers of the simulated plant differ.
  [[nodiscard]] bool shares_settings() const noexcept { return shares_settings_; }

 private:
  void check_metrics() const;
  [[nodiscard]] bool can_share_settings() const;

  StudyScript script_;
  std::vector<StudyCase> cases_;
  std::vector<std::vector<Contender>> contenders_{};  ///< by case
  Design design_;
  std::vector<std::size_t> range_of_factor_{};  ///< its number among the factors with ranges
  std::uint64_t level_combinations_{1};
  std::uint64_t runs_{0};
  bool shares_settings_{false};
};

/// The paper brakes from 1625 rpm, 170 rad/s. Simulated studies begin there unless the configuration says otherwise.
inline constexpr const char* start_speed_default = "experiment.start_speed_rad_s=170";

/// The study with its plants and experiments looked up. Throws config::ConfigError and std::invalid_argument.
[[nodiscard]] Study make_study(StudyScript script);

}  // namespace abs_hil::study

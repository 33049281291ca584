#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/config_file.hpp"
#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::program {

/// The files of a run's records, and whether the run is in virtual time.
struct OutputOptions {
  bool fast{false};
  std::optional<std::string> csv_file{};
  std::optional<std::string> log_file{};
  std::optional<std::string> summary_file{};
  std::optional<std::string> histogram_file{};
  std::optional<std::string> recorder_dir{};  ///< --recorder: folder of the flight record, written after a fault
  std::optional<std::string> lcm_url{};
  bool no_lcm{false};
  std::optional<std::string> run_folder{};  ///< --out: a new or empty folder
  bool no_run_folder{false};                ///< --no-out

  /// True if an option names a file for the run's records.
  [[nodiscard]] bool names_files() const { return csv_file || log_file || summary_file || histogram_file; }
};

/// The options of `abs_hil` as typed, before they are merged with files.
struct RunOptions {
  std::string backend{"sim"};
  std::optional<std::string> config_file{};
  std::optional<std::string> plant{};
  std::optional<std::string> model{};
  std::optional<std::string> controller{};
  std::optional<std::string> experiment{};
  std::optional<std::string> slip_ref{};
  std::optional<std::string> rate_Hz{};
  std::optional<std::string> seed{};
  std::vector<std::string> defaults{};  ///< assignments of lowest priority, below files and options
  std::vector<std::string> assignments{};
  std::vector<config::FileValue> changes{};  ///< values as they are, above all others: of a study, a series, Python
  bool one_of_series{false};                 ///< the run's script is one run of the series that its file describes
  bool wait_for_start{false};
  std::vector<std::string> injections{};  ///< faults to inject, in addition to those of run.inject
  std::optional<std::string> realtime{};  ///< --rt; none: require on a real board, otherwise prefer
  OutputOptions outputs{};
};

/// The options of `abs_hil compare` as typed.
struct CompareOptions {
  RunOptions run{};  ///< only plant, model, configuration file and assignments are used
  std::string controllers{"adaptive,sliding-mode"};
  std::size_t repeat{100};
  std::uint64_t seed{1};
  std::optional<std::string> vary{};
  std::size_t threads{0};  ///< 0: one for each processor
  std::optional<std::string> json_file{};
  std::optional<std::string> csv_file{};
  std::optional<std::string> markdown_file{};
  std::optional<std::string> runs_file{};
  std::optional<int> recorded_run{};        ///< --run: repeat this run of each controller in place of the comparison
  std::optional<std::string> run_folder{};  ///< --out: its folder
};

/// A completely specified run: its effective configuration and the files of its records.
struct RunRequest {
  config::Settings settings{};
  std::shared_ptr<const config::Script> script{};  ///< the experiment
  std::string config_json{};                       ///< the effective configuration
  std::string config_toml{};                       ///< the same, as a file for --config
  OutputOptions outputs{};
  std::vector<std::string> command_line{};  ///< as typed; recorded in environment.json
  /// Set for one run of a series: the run prints only faults, and calls this now and then with its current phase.
  std::function<void(std::string_view phase)> in_series{};
  /// Called after a run of a series if somebody sent it a stop, even one that came too late for that run.
  std::function<void()> stop_was_sent{};
};

/// The options of a run in virtual time without files, from pairs of words: "--controller", "adaptive", "--set",
/// "control.slip_ref=0.2". Knows those that choose what is computed. Throws config::ConfigError for any other.
[[nodiscard]] RunOptions options_of(const std::vector<std::string>& words);
/// The options of one run of a series.
[[nodiscard]] RunOptions options_of(const RunOptions& common, const config::SeriesMember& member);
/// Its varied values as a JSON object.
[[nodiscard]] nlohmann::ordered_json varied_json(const config::SeriesMember& member);
/// Refuses an experiment of a series that is a series itself. Throws config::ConfigError.
void refuse_nested(const config::Script& series, const config::Script& experiment);
/// Merges defaults, plant file, model file, the script's settings, configuration file, named options, assignments and
/// changes; later ones win. Throws config::ConfigError.
[[nodiscard]] RunRequest merge(const RunOptions& options);
/// The request of a run with these settings, as a merge left them or with other values since.
[[nodiscard]] RunRequest request_of(config::Settings settings, OutputOptions outputs);
/// The settings alone, without the texts of the configuration for files, which cost as much again.
[[nodiscard]] config::Settings merged_settings(const RunOptions& options);

}  // namespace abs_hil::program

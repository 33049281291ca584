#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/merge.hpp"
#include "files/result_file.hpp"

namespace abs_hil::program {

/// The files of a run's records, and its network.
struct OutputOptions {
  std::optional<std::string> csv_file{};
  std::optional<std::string> log_file{};
  std::optional<std::string> summary_file{};
  std::optional<std::string> histogram_file{};
  std::optional<std::string> recorder_dir{};  ///< --recorder: folder of the flight record, written after a fault
  std::optional<std::string> prior_file{};    ///< --prior, renewed after a stop
  std::optional<std::string> lcm_url{};
  bool no_lcm{false};
  std::optional<std::string> run_folder{};  ///< --out: a new or empty folder
  bool no_run_folder{false};                ///< --no-out

  /// True if an option names a file for the run's records.
  [[nodiscard]] bool names_files() const { return csv_file || log_file || summary_file || histogram_file; }
};

/// The options of `abs_hil` as typed, before they are merged with files.
struct RunOptions : config::Sources {
  OutputOptions outputs{};
};

/// A completely specified run: its effective configuration and the files of its records.
struct RunRequest : config::Configuration {
  OutputOptions outputs{};
  bool virtual_time{false};                 ///< --fast
  std::vector<std::string> command_line{};  ///< as typed; recorded in environment.json
  /// Set for one run of a series: the run prints only faults, and calls this now and then with its current phase.
  std::function<void(std::string_view phase)> in_series{};
  /// Called after a run of a series if somebody sent it a stop, even one that came too late for that run.
  std::function<void()> stop_was_sent{};
};

/// True if the run takes commands over LCM.
[[nodiscard]] bool hears_commands(const RunRequest& request);
/// True if stdin is a terminal.
[[nodiscard]] bool at_terminal() noexcept;
/// Refuses a run whose questions nobody could answer, or that would move a rig without a person's answer. Throws
/// config::ConfigError.
void check_questions(const RunRequest& request);

/// Opens a result before anything moves, so that a bad path is reported at once; null without a path. Throws
/// config::ConfigError. @param kind  for messages, as "histogram"
[[nodiscard]] std::unique_ptr<files::ResultFile> open_result(const std::optional<std::string>& path,
                                                             const std::string& kind);

/// No result of this process may replace a file that these name.
void keep_inputs(const config::Sources& sources);

/// The options as a run. A person answers its questions on a rig or at a terminal. Throws config::ConfigError.
[[nodiscard]] RunRequest merge(const RunOptions& options);

}  // namespace abs_hil::program

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/script.hpp"
#include "config/settings.hpp"

namespace abs_hil::program {

/// Where a run's records go, and whether it runs in virtual time.
struct OutputOptions {
  bool fast{false};
  std::optional<std::string> csv_file{};
  std::optional<std::string> log_file{};
  std::optional<std::string> summary_file{};
  std::optional<std::string> histogram_file{};
  std::optional<std::string> recorder_dir{};  ///< --recorder: where the flight record goes after a fault
  std::optional<std::string> lcm_url{};
  bool no_lcm{false};
  std::optional<std::string> run_folder{};  ///< --out: new or empty
  bool no_run_folder{false};                ///< --no-out

  /// True if a run's records go to files that were named one by one.
  [[nodiscard]] bool names_files() const { return csv_file || log_file || summary_file || histogram_file; }
};

/// The options of `abs_hil` as typed, before they are merged with files.
struct RunOptions {
  std::string backend{"sim"};
  std::optional<std::string> config_file{};
  std::optional<std::string> plant{};
  std::optional<std::string> controller{};
  std::optional<std::string> experiment{};
  std::optional<std::string> slip_ref{};
  std::optional<std::string> rate_Hz{};
  std::optional<std::string> seed{};
  std::vector<std::string> defaults{};  ///< assignments that files and options may override
  std::vector<std::string> assignments{};
  bool wait_for_start{false};
  std::vector<std::string> injections{};  ///< faults to inject, beside those of run.inject
  std::string realtime{"prefer"};
  OutputOptions outputs{};
};

/// The options of `abs_hil compare` as typed.
struct CompareOptions {
  RunOptions run{};  ///< plant, configuration file and assignments are taken from it
  std::vector<std::string> controllers{"adaptive", "sliding-mode"};
  std::size_t repeat{100};
  std::uint64_t seed{1};
  std::optional<std::string> vary{};
  std::size_t threads{0};  ///< 0: as many as the machine runs at once
  std::optional<std::string> json_file{};
  std::optional<std::string> csv_file{};
  std::optional<std::string> markdown_file{};
  std::optional<std::string> runs_file{};
};

/// A run as it will be: the effective configuration and where its records go.
struct RunRequest {
  config::Settings settings{};
  std::shared_ptr<const config::Script> script{};  ///< what is run
  std::string config_json{};                       ///< the effective configuration
  std::string config_toml{};                       ///< the same, as a file for --config
  OutputOptions outputs{};
  std::vector<std::string> command_line{};  ///< as typed, for the record
  /// Not empty: a run of a series, which prints nothing but faults and tells now and then which phase it is in.
  std::function<void(std::string_view phase)> in_series{};
  /// Called after such a run if somebody has sent it a stop, in time for it or not.
  std::function<void()> stop_was_sent{};
};

/// Merges defaults, plant file, the script's settings, configuration file, named options and assignments, later ones
/// winning. Throws config::ConfigError.
[[nodiscard]] RunRequest merge(const RunOptions& options);

}  // namespace abs_hil::program

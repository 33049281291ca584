#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace abs_hil::report {

/// A line of a run folder's events.csv.
struct RunEvent {
  double time_s{0.0};
  std::string event{};  ///< phase, fault, limit, ...
  std::string phase{};
  std::string reason{};
  std::string value{};
  /// True for an event that is neither a change of phase nor the regular end.
  [[nodiscard]] bool unusual() const { return event != "phase" && !(event == "limit" && phase == "stopped"); }
};

/// Numbers of cycles by the duration of their parts, as abs_hil --histogram writes them.
struct TimingHistogram {
  static constexpr std::array<std::string_view, 5> parts{"wake-up latency", "read", "control", "write", "whole cycle"};
  std::array<std::vector<std::uint64_t>, 5> counts{};  ///< index: duration in microseconds, from 0
  std::array<std::uint64_t, 5> overflows{};
};

/// All files of a run except its rows. All but the CSV may be missing; `notes` say what is missing.
struct RunFiles {       // NOLINT(bugprone-exception-escape): JSON's move constructor is in fact noexcept
  std::string name{};   ///< from folder or file; different for every run
  std::string label{};  ///< name, and the controller if known
  std::filesystem::path csv{};
  std::filesystem::path folder{};  ///< empty for a bare CSV file
  nlohmann::ordered_json summary = nlohmann::ordered_json::object();
  std::map<std::string, std::string> config{};       ///< effective configuration by dotted key
  std::map<std::string, std::string> environment{};  ///< kernel, build, board, by dotted key
  std::vector<RunEvent> events{};
  std::optional<TimingHistogram> histogram{};
  std::vector<std::string> notes{};

  /// A number from the summary; NaN if it has none.
  [[nodiscard]] double number(const std::string& dotted_key) const;
  /// A string from the summary; empty if it has none.
  [[nodiscard]] std::string text(const std::string& key) const;
  /// A number from the configuration; `otherwise` if it has none.
  [[nodiscard]] double config_number(const std::string& key, double otherwise) const;
};

/// A series of runs: the runs of one series folder.
struct Series {
  std::string name{};
  std::vector<std::size_t> runs{};  ///< indices into FoundRuns::runs
};

struct FoundRuns {
  std::vector<RunFiles> runs{};
  std::vector<Series> series{};
  std::vector<std::string> notes{};  ///< about runs that were left out, with the reason
};

/// Reads the arguments of the command line: CSV files, run folders, series folders. `labels` is empty or has one entry
/// per run. Throws InputError for anything else and for what cannot be read.
[[nodiscard]] FoundRuns find_runs(const std::vector<std::filesystem::path>& arguments,
                                  const std::vector<std::string>& labels = {});

/// Configuration keys whose values differ between the runs that have a configuration.
[[nodiscard]] std::vector<std::string> differing_keys(const std::vector<RunFiles>& runs);

}  // namespace abs_hil::report

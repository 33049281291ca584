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
  /// Neither a change of phase nor the regular end, which every run has.
  [[nodiscard]] bool unusual() const { return event != "phase" && !(event == "limit" && phase == "stopped"); }
};

/// Cycles counted by how long a part of them took, as abs_hil --histogram writes them.
struct TimingHistogram {
  static constexpr std::array<std::string_view, 5> parts{"wake-up latency", "read", "control", "write", "whole cycle"};
  std::array<std::vector<std::uint64_t>, 5> counts{};  ///< by microseconds, from 0 on
  std::array<std::uint64_t, 5> overflows{};
};

/// What is known of a run besides its rows. Everything but the CSV may be missing; `notes` say what is.
struct RunFiles {       // NOLINT(bugprone-exception-escape): JSON's move constructor is noexcept all the same
  std::string name{};   ///< of folder or file; made unlike those of the other runs
  std::string label{};  ///< name, and the controller where it is known
  std::filesystem::path csv{};
  std::filesystem::path folder{};  ///< empty for a bare CSV file
  nlohmann::ordered_json summary = nlohmann::ordered_json::object();
  std::map<std::string, std::string> config{};       ///< effective configuration by dotted key
  std::map<std::string, std::string> environment{};  ///< kernel, build, board, by dotted key
  std::vector<RunEvent> events{};
  std::optional<TimingHistogram> histogram{};
  std::vector<std::string> notes{};

  /// A number of the summary; NaN where it has none.
  [[nodiscard]] double number(const std::string& dotted_key) const;
  /// A string of the summary; empty where it has none.
  [[nodiscard]] std::string text(const std::string& key) const;
  /// A number of the configuration; `otherwise` where it has none.
  [[nodiscard]] double config_number(const std::string& key, double otherwise) const;
};

/// A folder of runs made in one go.
struct Series {
  std::string name{};
  std::vector<std::size_t> runs{};  ///< indices into FoundRuns::runs
};

struct FoundRuns {
  std::vector<RunFiles> runs{};
  std::vector<Series> series{};
  std::vector<std::string> notes{};  ///< of runs that were left out, and why
};

/// Reads what was named on the command line: CSV files, run folders, folders of series. `labels`, where given, are one
/// for each run. Throws InputError for what is none of these or cannot be read.
[[nodiscard]] FoundRuns find_runs(const std::vector<std::filesystem::path>& arguments,
                                  const std::vector<std::string>& labels = {});

/// Keys whose values are not the same in all runs that have a configuration.
[[nodiscard]] std::vector<std::string> differing_keys(const std::vector<RunFiles>& runs);

}  // namespace abs_hil::report

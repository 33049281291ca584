// The folder of a series of runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "run_folder/run_folder.hpp"

namespace abs_hil::run_folder {

inline constexpr std::string_view series_index = "series.json";

/// One run in the index of a series of runs.
struct SeriesEntry {
  nlohmann::ordered_json varied = nlohmann::ordered_json::object();  ///< configuration key: value
  std::int64_t seed{0};
  std::string status{"planned"};  ///< then "completed", "fault" or "stopped"
};

/// The folder of a series of runs: series.json and one whole run folder for each run: run-0001/, run-0002/, ... A run
/// writes into run-0001.part/, which is renamed when it is complete, with its SHA256SUMS. Opened again for the same
/// series, it continues where it stopped and keeps an incomplete run's files beside it as run-0001.interrupted-1/.
/// Thread-safe.
class SeriesFolder {
 public:
  /// @param identity  digest of the series' content: a folder of another series is refused
  /// @param title  name of the experiment, for the index
  /// Throws FolderError for a folder that holds anything but this series.
  SeriesFolder(std::filesystem::path path, std::string identity, std::string title, std::vector<SeriesEntry> runs);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] bool resumed() const noexcept { return resumed_; }
  /// True if the run has ended and its folder is complete.
  [[nodiscard]] bool done(std::size_t run) const;
  /// The run's status; "planned" if it has not ended.
  [[nodiscard]] std::string status(std::size_t run) const;
  /// "run-0001" for run 0.
  [[nodiscard]] static std::string name_of(std::size_t run);
  /// Returns a new, empty place for the run's files. Throws FolderError.
  [[nodiscard]] std::filesystem::path begin(std::size_t run);
  /// Records the run's status in the index and renames its folder. Throws FolderError and files::FileError.
  /// @return false if its record is not complete: then the run must be repeated
  [[nodiscard]] bool end(std::size_t run, const std::string& status);

 private:
  void read_index(const std::string& identity);
  void write_index() const;

  std::filesystem::path path_;
  std::string identity_;
  std::string title_;
  std::vector<SeriesEntry> runs_;
  bool resumed_{false};
  mutable std::mutex mutex_;
};

}  // namespace abs_hil::run_folder

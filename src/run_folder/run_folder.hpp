#pragma once

#include <cstddef>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <nlohmann/json_fwd.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace abs_hil::run_folder {

/// An unusable run folder; the message is one line with path, reason and fix.
class FolderError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// File names in a run folder (docs/experiments.md, "Run folders").
namespace file {
inline constexpr std::string_view csv = "run.csv";
inline constexpr std::string_view log = "run.lcmlog";
inline constexpr std::string_view summary = "summary.json";
inline constexpr std::string_view config = "config.toml";
inline constexpr std::string_view experiment = "experiment.toml";
inline constexpr std::string_view environment = "environment.json";
inline constexpr std::string_view events = "events.csv";
inline constexpr std::string_view histogram = "histogram.txt";
inline constexpr std::string_view checksums = "SHA256SUMS";
}  // namespace file

/// The folder of one run. The constructor creates it; seal() completes it with checksums.
class RunFolder {
 public:
  /// Creates the folder and its parents. Throws FolderError if it is a file, not empty, or cannot be created.
  explicit RunFolder(std::filesystem::path path);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] std::filesystem::path of(std::string_view name) const { return path_ / name; }
  /// Throws FolderError if the file cannot be written.
  void write(std::string_view name, std::string_view text) const;
  void write(std::string_view name, const nlohmann::ordered_json& json) const;
  /// Writes SHA256SUMS over every file in the folder, in the format of sha256sum. Its presence marks a complete record.
  void seal() const;

 private:
  std::filesystem::path path_;
};

/// Compares the files of a folder with its SHA256SUMS. Throws FolderError with the name of the first that has changed,
/// and for a damaged SHA256SUMS. Missing files are left to the reader that wants them. A folder without SHA256SUMS, of
/// a run that did not end, is not judged.
void check_seal(const std::filesystem::path& folder);

/// SHA-256 of a file: 64 hexadecimal digits. Throws FolderError if the file cannot be read.
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& path);
/// SHA-256 of a text: 64 hexadecimal digits.
[[nodiscard]] std::string sha256_of(std::string_view text);

/// What a run depended on besides its configuration.
struct RunEnvironment {
  std::vector<std::string> command_line;
  std::string backend;
  std::string board;                     ///< name of the driver, as "pci"; "sim" for the simulator
  std::vector<std::string> board_notes;  ///< what the driver reports about its board
  bool emulated{false};                  ///< the board is an emulator
  bool virtual_time{false};              ///< --fast
  bool realtime{false};                  ///< every required step of the real-time set-up was obtained
  std::string realtime_shortcomings{};   ///< as text; empty if none
};

/// Content of environment.json: the facts above, this computer (kernel, host, processors) and the date in UTC.
[[nodiscard]] nlohmann::ordered_json environment_json(const RunEnvironment& run);

/// Parent of run folders that have no name given: $ABS_HIL_RUNS_DIR, else `runs`. Empty if that variable is set but
/// empty.
[[nodiscard]] std::filesystem::path default_runs_dir();

/// The text as a name of a folder below `parent`: letters and digits of ASCII, `_=.` and letters of scripts that have
/// no form in ASCII here. Marks go (a for an umlaut), other characters become dashes, one for several, and the end is
/// cut to what the file system allows less `spare_bytes`. Two texts may have the same name. Never empty.
[[nodiscard]] std::string folder_name(std::string_view text, const std::filesystem::path& parent,
                                      std::size_t spare_bytes = 0);

/// Makes a folder below `parent`: `20261121-134512-paper`, with -2, -3, ... if that is taken. RunFolder says why if it
/// could not.
/// @param local_time  start of the run, broken down
[[nodiscard]] std::filesystem::path unused_folder(const std::filesystem::path& parent, const std::tm& local_time,
                                                  std::string_view experiment);

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

// The folder of a study's results (docs/studies.md).
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "study/study.hpp"

namespace abs_hil::study {

/// File names in a study's folder (docs/studies.md).
namespace file {
inline constexpr std::string_view index = "study.json";
inline constexpr std::string_view text = "study.toml";
inline constexpr std::string_view parts = "parts";
inline constexpr std::string_view results = "results.csv.gz";
}  // namespace file

/// What study.json says: all that results of different processes must have in common.
struct StudyFacts {
  std::string identity{};  ///< SHA-256 of everything that the results depend on, this program included
  std::string program{};   ///< version and revision
  std::string name{};
  std::string text{};  ///< of the study's file
  std::string description{};
  std::string design{};  ///< its kind
  std::uint64_t runs{0};
  std::uint64_t chunk{0};
  std::vector<std::string> columns{};  ///< of the results: what a run is made of, how it ended, its metrics
  std::vector<std::string> ranges{};   ///< keys of the factors whose values the design spreads
  std::vector<std::string> levels{};   ///< keys of the others
  std::vector<std::string> metrics{};  ///< of every run, then the study's own
  std::string configurations{};        ///< effective configuration of each case, as JSON

  /// Number of files of results.
  [[nodiscard]] std::uint64_t chunks() const noexcept { return (runs + chunk - 1) / chunk; }
  /// Number of runs in a chunk; the last one may have fewer.
  [[nodiscard]] std::uint64_t runs_in(std::uint64_t number) const noexcept {
    return std::min(chunk, runs - number * chunk);
  }
};

/// @param name  of the study, for people
[[nodiscard]] StudyFacts facts_of(const Study& study, const std::string& name);

/// The folder of a study: study.json, study.toml, a file in parts/ for every finished chunk of runs, and at the end
/// results.csv.gz in their place. Every file appears whole or not at all, so any number of processes on any computers
/// may work in it at the same time, end at any moment and begin again.
/// All members throw std::runtime_error with path and reason for a folder that cannot be read or written.
class StudyFolder {
 public:
  /// Opens the folder for a study, or creates it. Throws config::ConfigError for the folder of another study or
  /// program, and for one that holds other files.
  StudyFolder(std::filesystem::path path, StudyFacts facts);
  /// Opens a folder that exists. Throws config::ConfigError if it holds no study.
  explicit StudyFolder(std::filesystem::path path);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] const StudyFacts& facts() const noexcept { return facts_; }
  /// True if results.csv.gz is there.
  [[nodiscard]] bool complete() const;
  /// By chunk: true if its file is there.
  [[nodiscard]] std::vector<bool> finished() const;
  /// True if the file of a chunk is there and has every row of it. Reads the file.
  [[nodiscard]] bool is_whole(std::uint64_t number) const;
  /// Writes the file of a chunk. @param rows  its rows of CSV, in order
  void write_chunk(std::uint64_t number, std::string_view rows) const;
  /// Puts the chunks together that lie in this and the other folders, and then removes the parts of this one. Each
  /// chunk is checked first. Memory does not grow with the runs. Throws std::runtime_error if chunks are missing,
  /// damaged or of another study, and config::ConfigError if a folder is; then nothing changes.
  void merge(const std::vector<StudyFolder>& others) const;

 private:
  void check_results() const;
  [[nodiscard]] std::filesystem::path part(std::uint64_t number) const;
  [[nodiscard]] std::string note_of(std::uint64_t number) const;
  [[nodiscard]] std::string checked_chunk(std::uint64_t number, const std::filesystem::path& file) const;

  std::filesystem::path path_;
  StudyFacts facts_;
};

/// "3, 17 to 20 and 812 more": numbers of chunks for messages.
[[nodiscard]] std::string list_of(const std::vector<std::uint64_t>& numbers);

/// One member of a gzip file. Members after each other are a gzip file, too, which every reader takes for one. The same
/// arguments give the same bytes with the same version of zlib: there is no time in it.
/// @param note  kept in the member's header, where readers of the content do not see it; without NUL. It stands in the
///   field for a file's name: DuckDB refuses a header with a comment.
[[nodiscard]] std::string gzip_member(std::string_view content, const std::string& note);

/// The note of the first member. @param bytes  the beginning of a gzip file, at least its first header
/// Throws std::runtime_error for anything else, and for a header without note.
[[nodiscard]] std::string gzip_note(std::string_view bytes);

struct GzipMember {
  std::string note{};
  std::string content{};
};
/// Reads a file's content that is one whole member. Throws std::runtime_error, without a path, for anything else and
/// for a wrong checksum.
[[nodiscard]] GzipMember read_gzip_member(std::string_view bytes);

}  // namespace abs_hil::study

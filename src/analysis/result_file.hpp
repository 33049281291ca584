#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace abs_hil::analysis {

/// A file of results that is either whole or not there: opened beside its place before the run, so that a bad path is
/// known before anything moves, and renamed into place once written.
class ResultFile {
 public:
  /// @param what "the summary", say, for messages. Throws std::runtime_error, naming path, reason and fix, if the file
  /// cannot be created.
  ResultFile(std::filesystem::path path, std::string what);
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;
  ~ResultFile();
  /// Throws std::runtime_error if the file cannot be written.
  void write(std::string_view text);

 private:
  std::filesystem::path path_;
  std::filesystem::path part_;
  std::string what_;
};

}  // namespace abs_hil::analysis

#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace abs_hil::analysis {

/// A result file that is either complete or absent. It is created under a temporary name before the run, so that a bad
/// path is reported before anything moves, and renamed once it is written.
class ResultFile {
 public:
  /// @param what  name for messages, as "the summary". Throws std::runtime_error with path, reason and fix if the file
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

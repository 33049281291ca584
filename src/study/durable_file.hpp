#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace abs_hil::study {

/// A file that appears whole or not at all, whatever ends the process or the computer: it is written under a name of
/// its own, brought to the disk, and renamed. Several processes on several computers may write the
/// same file at the same time; the last one wins.
class DurableFile {
 public:
  /// @param folder  where it is written until it is whole, on the same file system; empty: beside its place. A process
  ///   that is killed leaves a file there.
  /// Throws std::runtime_error with path and reason, as all members do.
  explicit DurableFile(std::filesystem::path path, const std::filesystem::path& folder = {});
  DurableFile(const DurableFile&) = delete;
  DurableFile& operator=(const DurableFile&) = delete;
  /// Removes what is not committed.
  ~DurableFile();
  void append(std::string_view bytes);
  void commit();

 private:
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  std::string part_;
  int file_{-1};
};

/// Writes the whole file at once.
void write_durably(const std::filesystem::path& path, std::string_view bytes, const std::filesystem::path& folder = {});

}  // namespace abs_hil::study

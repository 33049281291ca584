#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

namespace abs_hil::files {

/// A file could not be opened or written. `what()` names the path, the reason and the fix.
class FileError : public std::runtime_error {
 public:
  /// `kind` is the kind of file, as in "CSV file". `error_number` is an errno.
  FileError(std::string_view kind, const std::filesystem::path& path, int error_number);
  /// `why` is the reason with its fix.
  FileError(std::string_view kind, const std::filesystem::path& path, std::string_view why, int error_number);

  [[nodiscard]] int error_number() const noexcept { return error_number_; }

 private:
  int error_number_;
};

/// The only way in which this program writes a result: a file that appears whole or not at all, whatever ends the
/// process or the computer. It is written under a name of its own beside its place, brought to the disk, and renamed.
/// Several processes on several computers may write the same file; the last one wins. The constructor opens it, so that
/// a bad path is reported before anything moves; an older file stays as it is until commit() or show().
///
/// The name "-" is stdout. It replaces regular files only. A symbolic link stays, and the file that it names is
/// replaced. A pipe, a terminal or another character device (/dev/stdout, /dev/null) receives the bytes as they come. A
/// folder, a block device, a socket and a pipe without a reader are refused, and so is a file that this process reads
/// (note_input) or has open as another result. Not real-time safe. All members throw FileError.
class ResultFile {
 public:
  /// @param kind  for messages, as "CSV file"
  /// @param part_folder  where it is written until it is whole, on the same file system; empty: beside its place. A
  ///   process that is killed leaves a file there.
  ResultFile(std::filesystem::path path, std::string kind, const std::filesystem::path& part_folder = {});
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;
  /// Removes what was neither committed nor shown.
  ~ResultFile();

  void append(std::string_view bytes);
  /// Bytes that can be appended before it has to write.
  [[nodiscard]] std::size_t room() const noexcept { return buffer_bytes - buffer_.size(); }
  /// Passes everything on to the operating system.
  void flush();
  /// Puts the file in its place before it is whole: the record of a run that has begun survives the program's death.
  void show();
  /// Puts the whole file in its place. No member may be called afterwards.
  void commit();
  /// append() and commit().
  void write(std::string_view whole);

  /// Where it is written at present; empty if the bytes go to a device, a pipe or a terminal.
  [[nodiscard]] const std::filesystem::path& part() const noexcept { return part_; }

 private:
  static constexpr std::size_t buffer_bytes = 65'536;

  void open_target(const std::filesystem::path& path, int links);
  void open_part(const std::filesystem::path& folder);
  void put(std::string_view bytes);
  [[noreturn]] void fail(int error_number) const;

  std::filesystem::path path_;  ///< as given, for messages
  std::string kind_;
  std::filesystem::path target_{};  ///< behind links; empty for a stream
  std::filesystem::path part_{};    ///< empty for a stream and once it stands in its place
  std::shared_ptr<void> claim_{};   ///< this process' only result there
  std::string buffer_{};
  unsigned mode_{0};  ///< of the older file; 0: there is none
  int file_{-1};
};

/// Where a command's words for people go: stdout, or stderr once a result goes to "-".
[[nodiscard]] std::FILE* for_people() noexcept;

/// No result of this process may replace this file, or a file of this folder: a command reads it.
void note_input(const std::filesystem::path& path);

/// Writes the whole file at once.
void write_result(const std::filesystem::path& path, const std::string& kind, std::string_view bytes,
                  const std::filesystem::path& part_folder = {});

}  // namespace abs_hil::files

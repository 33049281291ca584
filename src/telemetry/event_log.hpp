#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace abs_hil::telemetry {

/// A file cannot be read as a recording: it is of another kind, damaged or incomplete. `what()` names file, place and
/// reason.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One event of an LCM event log.
struct LogEvent {
  std::int64_t number{0};
  std::int64_t timestamp_us{0};  ///< since 1970
  std::string channel;
  std::vector<std::uint8_t> data;
};

namespace detail {
struct FileCloser {
  void operator()(std::FILE* file) const noexcept { static_cast<void>(std::fclose(file)); }
};
using FilePointer = std::unique_ptr<std::FILE, FileCloser>;
}  // namespace detail

/// Reads LCM's event logs. It checks sync words, lengths and event numbers. lcm::LogFile skips damage silently instead.
class EventLogReader {
 public:
  /// Throws RecordingError when the file cannot be opened.
  explicit EventLogReader(std::filesystem::path path);

  /// Returns the next event, or nothing at the end. Throws RecordingError if the file is damaged or cut off.
  [[nodiscard]] std::optional<LogEvent> next();

 private:
  [[noreturn]] void fail(const std::string& what) const;

  std::filesystem::path path_;
  detail::FilePointer file_;
  std::uint64_t size_{0};
  std::uint64_t at_{0};
  std::int64_t events_{0};
};

/// Writes events with their own numbers and times.
class EventLogWriter {
 public:
  /// Creates or empties the file. Throws FileError.
  explicit EventLogWriter(std::filesystem::path path);
  /// Both throw FileError when it cannot be written.
  void write(const LogEvent& event);
  void finish();

 private:
  std::filesystem::path path_;
  detail::FilePointer file_;
};

}  // namespace abs_hil::telemetry

#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
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

/// Reads LCM's event logs. It checks sync words, lengths and event numbers. lcm::LogFile skips damage silently instead.
/// A killed program leaves a part of a message at the end of its log: there the log ends, and `cut` says so.
class EventLogReader {
 public:
  /// Throws RecordingError when the file cannot be opened.
  explicit EventLogReader(std::filesystem::path path);

  /// Returns the next event, or nothing at the end. Throws RecordingError if the file is damaged.
  [[nodiscard]] std::optional<LogEvent> next();
  /// After the end: where the last message is cut off, in words; empty if it is whole.
  [[nodiscard]] const std::string& cut() const noexcept { return cut_; }

 private:
  [[nodiscard]] std::string place(const std::string& what) const;
  [[noreturn]] void fail(const std::string& what) const { throw RecordingError(place(what)); }
  std::optional<LogEvent> end_cut_off();

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t size_{0};
  std::uint64_t at_{0};
  std::int64_t events_{0};
  std::string cut_{};
};

/// Calls `take` for every event of a log, in order. Returns EventLogReader::cut. Throws RecordingError, even after some
/// calls.
std::string for_each_event(const std::filesystem::path& log, const std::function<void(const LogEvent&)>& take);

/// Appends an event to the bytes of a log, as LCM does.
void append_event(std::string& log, std::int64_t number, std::int64_t timestamp_us, std::string_view channel,
                  std::span<const std::uint8_t> data);

}  // namespace abs_hil::telemetry

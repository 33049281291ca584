#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "telemetry/event_log.hpp"

namespace abs_hil::telemetry {

// Converts an event log to CSV, for spreadsheets and scripts, and back without loss. RUN.csv holds the telemetry: first
// the fixed columns of --csv that telemetry_t has, then all other fields. Every other channel has its own file
// RUN.CHANNEL.csv beside it, with the fields of its type as columns. RUN.raw.csv holds, as hexadecimal digits, events
// of unknown types and events that their text would not reproduce bit for bit. Each row ends with the event's number
// and time, its channel and its type.

/// Numbers of events.
struct ConversionCounts {
  std::uint64_t events{0};
  std::uint64_t raw{0};  ///< events written as hexadecimal digits
  std::string cut{};     ///< EventLogReader::cut of the log
};

/// Event log -> CSV. All files appear, or none. Throws RecordingError and files::FileError.
ConversionCounts log_to_csv(const std::filesystem::path& log, const std::filesystem::path& csv);
/// CSV, as log_to_csv wrote it, -> event log, the same bytes. Throws RecordingError and files::FileError.
ConversionCounts csv_to_log(const std::filesystem::path& csv, const std::filesystem::path& log);

/// Calls `take` for every event of a recording, in order. The recording is an event log, or CSV of log_to_csv if its
/// name ends in .csv. Returns EventLogReader::cut. Throws RecordingError, even after some calls.
std::string for_each_event(const std::filesystem::path& recording, const std::function<void(const LogEvent&)>& take);

}  // namespace abs_hil::telemetry

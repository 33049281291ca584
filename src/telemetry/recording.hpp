#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

#include "telemetry/event_log.hpp"

namespace abs_hil::telemetry {

// An event log as CSV, for spreadsheets and scripts, and back without loss. RUN.csv holds the telemetry, with the
// columns of --csv first and all other fields after them; every other channel has a file of its own beside it,
// RUN.CHANNEL.csv, with its type's fields as columns; what is of no type of ours, or does not come out of its text bit
// for bit, stands in RUN.raw.csv as hexadecimal digits. Each row ends with the event's number and time, its channel and
// its type.

/// How many events went where.
struct ConversionCounts {
  std::uint64_t events{0};
  std::uint64_t raw{0};  ///< of them as hexadecimal digits
};

/// Event log -> CSV. Throws RecordingError and FileError.
ConversionCounts log_to_csv(const std::filesystem::path& log, const std::filesystem::path& csv);
/// CSV, as log_to_csv wrote it, -> event log, the same bytes. Throws RecordingError and FileError.
ConversionCounts csv_to_log(const std::filesystem::path& csv, const std::filesystem::path& log);

/// Calls `take` for every event of a recording, in order: an event log, or CSV as log_to_csv writes it (by its name's
/// end, .csv). Throws RecordingError, also after some calls.
void for_each_event(const std::filesystem::path& recording, const std::function<void(const LogEvent&)>& take);

}  // namespace abs_hil::telemetry

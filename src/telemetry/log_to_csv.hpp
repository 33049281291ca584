#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace abs_hil::telemetry {

/// Numbers of events.
struct ConversionCounts {
  std::uint64_t events{0};
  std::uint64_t raw{0};  ///< events of unknown types, written as hexadecimal digits
  std::string cut{};     ///< EventLogReader::cut of the log
  std::string lacks{};   ///< quantities of this version that the log of another version lacks, by name; empty: none
};

/// An event log as CSV, for spreadsheets and scripts. RUN.csv holds the telemetry of the first channel that has any:
/// the columns of --csv, then every other quantity. Every other channel has its own file RUN.CHANNEL.csv beside it,
/// with the fields of its type as columns. RUN.raw.csv holds events of unknown types, as hexadecimal digits. Each row
/// ends with the event's number and time, its channel and its type. All files appear, or none. Throws RecordingError
/// and files::FileError.
ConversionCounts log_to_csv(const std::filesystem::path& log, const std::filesystem::path& csv);

}  // namespace abs_hil::telemetry

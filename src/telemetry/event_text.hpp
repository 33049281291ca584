#pragma once

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "telemetry/recording.hpp"

/// The events of a log as rows of CSV, and back. Not real-time safe.
namespace abs_hil::telemetry {

using Fields = std::vector<std::string>;
using Columns = std::map<std::string, std::size_t, std::less<>>;  ///< place of each name

/// The columns with which each row says which event it is.
inline constexpr std::string_view event_columns = "log_event,log_time_us,channel,type";
/// Type of an event whose bytes no message type gives back. Its row holds the bytes.
inline constexpr std::string_view raw_type = "raw";

/// Columns of --csv that telemetry does not hold: the values come from messages of other channels. They are in the CSV
/// for its readers only; csv_to_log takes the messages from their own files.
struct CellsFromElsewhere {
  bool sample_valid{true};
  bool wheels_apart{false};
  double sample_time_s{0.0};
};

/// An event in CSV: the type and header of its file, and its row.
struct EventText {
  std::string type;
  std::string header;
  std::string row;
};

/// The event as text that gives its bytes again.
[[nodiscard]] EventText text_of(const LogEvent& event, const CellsFromElsewhere& elsewhere = {});

/// Header of a file of telemetry.
[[nodiscard]] std::string telemetry_header();

[[nodiscard]] Columns columns_of(const Fields& header);

/// Returns the bytes of the row's event. Throws std::invalid_argument that names the column if the row gives none.
[[nodiscard]] std::vector<std::uint8_t> event_bytes(const Columns& columns, const Fields& fields);

}  // namespace abs_hil::telemetry

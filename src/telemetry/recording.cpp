#include "telemetry/recording.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <utility>

#include "telemetry/csv_parts.hpp"
#include "telemetry/csv_text.hpp"
#include "telemetry/event_text.hpp"

namespace abs_hil::telemetry {

namespace fs = std::filesystem;

std::vector<fs::path> csv_parts(const fs::path& csv) {
  std::vector<fs::path> parts;
  const std::string prefix = csv.stem().string() + '.';
  std::error_code error;
  const fs::path folder = csv.has_parent_path() ? csv.parent_path() : fs::path(".");
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const fs::path name = entry.path().filename();
    const bool is_part = name.extension() == ".csv" && name.string().starts_with(prefix) && name != csv.filename();
    if (is_part) parts.push_back(entry.path());
  }
  std::sort(parts.begin(), parts.end());
  return parts;
}

namespace {

[[noreturn]] void fail(const fs::path& path, std::uint64_t row, const std::string& what) {
  throw RecordingError("'" + path.string() + "': row " + std::to_string(row) + ": " + what);
}

void read_csv(const fs::path& path, std::map<std::int64_t, LogEvent>& events) {
  const detail::FilePointer file(std::fopen(path.c_str(), "rb"));
  if (!file) throw RecordingError("'" + path.string() + "': " + std::strerror(errno));
  CsvRows rows(file.get());
  Fields header;
  const bool any = rows.next(header);
  const Columns columns = columns_of(header);
  const bool whole = columns.contains("log_event") && columns.contains("log_time_us") && columns.contains("channel") &&
                     columns.contains("type");
  if (!any || !whole) {
    throw RecordingError("'" + path.string() + "': no columns " + std::string(event_columns) +
                         "; a run's --csv holds neither encoder counts nor configuration; give its event log (--log), "
                         "or CSV that abs_hil convert made of one");
  }
  Fields fields;
  while (rows.next(fields)) {
    if (fields.size() != header.size()) {
      fail(path, rows.row(), std::to_string(fields.size()) + " fields instead of " + std::to_string(header.size()));
    }
    LogEvent event;
    if (!parse_number(fields[columns.at("log_event")], event.number) ||
        !parse_number(fields[columns.at("log_time_us")], event.timestamp_us)) {
      fail(path, rows.row(), "log_event or log_time_us is not a whole number");
    }
    event.channel = fields[columns.at("channel")];
    try {
      event.data = event_bytes(columns, fields);
    } catch (const std::invalid_argument& error) {
      fail(path, rows.row(), error.what());
    }
    const std::int64_t number = event.number;
    if (!events.emplace(number, std::move(event)).second) {
      fail(path, rows.row(), "log_event " + std::to_string(number) + " occurs twice");
    }
  }
}

std::map<std::int64_t, LogEvent> read_all_csv(const fs::path& csv) {
  std::map<std::int64_t, LogEvent> events;
  read_csv(csv, events);
  for (const fs::path& part : csv_parts(csv)) read_csv(part, events);
  return events;
}

}  // namespace

ConversionCounts csv_to_log(const fs::path& csv, const fs::path& log) {
  const auto events = read_all_csv(csv);
  EventLogWriter writer(log);
  ConversionCounts counts;
  for (const auto& [number, event] : events) {
    writer.write(event);
    ++counts.events;
  }
  writer.finish();
  return counts;
}

std::string for_each_event(const fs::path& recording, const std::function<void(const LogEvent&)>& take) {
  if (recording.extension() == ".csv") {
    for (const auto& [number, event] : read_all_csv(recording)) take(event);
    return {};
  }
  EventLogReader reader(recording);
  for (;;) {
    const auto event = reader.next();
    if (!event) return reader.cut();
    take(*event);
  }
}

}  // namespace abs_hil::telemetry

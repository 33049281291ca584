// Reads the files that a faulty run leaves, and says what is wrong with them.
#include "kept_files.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string_view>

#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/flight_record.hpp"
#include "telemetry/message_codec.hpp"

namespace abs_hil::experiment::test {

namespace {

std::string content(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return std::move(text).str();
}

std::vector<std::string> columns_of(std::string_view row) {
  std::vector<std::string> columns(1);
  for (const char c : row) {
    if (c == ',') {
      columns.emplace_back();
    } else {
      columns.back() += c;
    }
  }
  return columns;
}

/// Reads the header and the number of rows, and the number of columns in all of them; `last_row` gets the last row.
std::string fault_of_table(const std::filesystem::path& csv, const std::string& header, std::size_t rows,
                           std::string& last_row) {
  const std::string name = csv.filename().string() + ": ";
  const std::string text = content(csv);
  if (!text.starts_with(header + '\n')) return name + "another header";
  if (text.back() != '\n') return name + "ends within a row";
  const auto lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  if (lines != rows + 1) return name + std::to_string(lines - 1) + " rows of " + std::to_string(rows);
  const auto separators = std::count(text.begin(), text.end(), ',');
  if (separators != std::count(header.begin(), header.end(), ',') * static_cast<std::ptrdiff_t>(lines)) {
    return name + "columns are missing";
  }
  const std::size_t begins = text.find_last_of('\n', text.size() - 2) + 1;
  last_row = text.substr(begins, text.size() - begins - 1);
  return {};
}

std::string fault_of_log(const std::filesystem::path& log, const rig::CycleRecord& last, std::size_t cycles) {
  std::size_t found = 0;
  event_t end{};
  telemetry::for_each_event(log, [&](const telemetry::LogEvent& event) {
    const auto fingerprint = telemetry::fingerprint_of(event.data);
    if (fingerprint == static_cast<std::int64_t>(telemetry_t::getHash())) ++found;
    if (fingerprint == static_cast<std::int64_t>(event_t::getHash())) {
      static_cast<void>(telemetry::decode_checked(event.data, end));
    }
  });
  if (found != cycles) return "event log: " + std::to_string(found) + " cycles of " + std::to_string(cycles);
  if (end.kind != "fault" || end.reason != static_cast<int>(last.reason)) {
    return "event log: ends with '" + end.kind + "', reason " + std::to_string(end.reason);
  }
  return {};
}

}  // namespace

std::string fault_of_csv(const std::filesystem::path& csv, const std::vector<rig::CycleRecord>& records) {
  std::string row;
  const std::string header(telemetry::csv_header);
  if (std::string fault = fault_of_table(csv, header, records.size(), row); !fault.empty()) return fault;
  const std::vector<std::string> columns = columns_of(row);
  const rig::CycleRecord& last = records.back();
  if (std::strtod(columns[0].c_str(), nullptr) != last.time_s) return "CSV: ends at " + columns[0] + " s";
  if (columns[1] != rig::name_of(last.phase)) return "CSV: ends in phase " + columns[1];
  return {};
}

std::string fault_of_recorder(const runtime::FlightRing& recorder, std::size_t slots,
                              const std::vector<rig::CycleRecord>& records, const std::filesystem::path& prefix) {
  const std::vector<rig::CycleRecord> kept = recorder.contents();
  if (kept.size() != std::min(slots, records.size())) {
    return "recorder: " + std::to_string(kept.size()) + " cycles of " + std::to_string(records.size());
  }
  const std::size_t first = records.size() - kept.size();
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const rig::CycleRecord& run = records[first + i];
    const bool same = kept[i].sequence == run.sequence && kept[i].phase == run.phase && kept[i].reason == run.reason &&
                      kept[i].measurement.upper_counts == run.measurement.upper_counts &&
                      kept[i].command.brake_duty == run.command.brake_duty &&
                      kept[i].command.motor_duty == run.command.motor_duty;
    if (!same) return "recorder: another cycle " + std::to_string(run.sequence);
  }

  const rig::CycleRecord& last = records.back();
  std::vector<std::string> problems;
  std::filesystem::remove(prefix.string() + ".txt");  // of the run before; a record does not replace an older one
  telemetry::write_flight_record(
      prefix, {.records = kept, .reason = last.reason, .reason_value = last.reason_value, .account = "a test\n"}, {},
      "ABS", problems);
  if (!problems.empty()) return problems.front();
  const auto file = [&prefix](const char* extension) { return std::filesystem::path(prefix.string() + extension); };
  const std::string reason = std::to_string(static_cast<int>(last.reason));
  if (!content(file(".txt")).starts_with("reason " + reason + ": ")) return "recorder: another reason in words";
  std::string row;
  const std::string header = std::string(telemetry::csv_header).append(telemetry::flight_csv_extra_header);
  if (std::string fault = fault_of_table(file(".csv"), header, kept.size(), row); !fault.empty()) return fault;
  const std::vector<std::string> names = columns_of(header);
  const auto column = static_cast<std::size_t>(std::find(names.begin(), names.end(), "reason") - names.begin());
  if (column == names.size() || columns_of(row)[column] != reason) {
    return "recorder: another reason in its last row";
  }
  return fault_of_log(file(".lcmlog"), last, kept.size());
}

}  // namespace abs_hil::experiment::test

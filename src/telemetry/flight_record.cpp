// Writes the last seconds before a fault as CSV, log and account.
#include "telemetry/flight_record.hpp"

#include <cmath>
#include <exception>

#include "abs_hil/rig/time_units.hpp"
#include "files/result_file.hpp"
#include "rig/reason_text.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"

namespace abs_hil::telemetry {
namespace {

constexpr const char* record_kind = "flight record";

void add_number(std::string& row, double value) { row.append(",").append(csv_number(value)); }

std::string extra_columns(const rig::CycleRecord& r) {
  std::string row = ',' + std::to_string(r.sequence) + ',' + std::to_string(r.stamp_ns);
  add_number(row, r.measurement.supply_V);
  add_number(row, r.measurement.temperature_C);
  row += ',' + std::to_string(r.measurement.trip_flags) + ',' + std::to_string(static_cast<int>(r.reason));
  add_number(row, r.reason_value);
  add_number(row, rig::in_us(r.timing.wakeup_latency_ns));
  add_number(row, rig::in_us(r.timing.cycle_ns));
  return row;
}

void write_csv(const std::filesystem::path& path, const FlightRecord& record, const rig::RunNames& names) {
  std::string text(csv_header);
  if (names.has_own_phase_names()) text.append(",").append(phase_name_column);
  text.append(flight_csv_extra_header);
  for (const std::string& signal : names.signals) text.append(",").append(signal);
  text += '\n';
  // The controller's own signals come last here.
  const rig::RunNames phases{.phases = names.phases};
  char row[csv_row_max_bytes];
  for (const rig::CycleRecord& r : record.records) {
    text.append(row, format_csv_row(r, rig::unknown, row, phases) - 1);  // without its line end
    text += extra_columns(r);
    for (std::size_t n = 0; n < names.signals.size(); ++n) add_number(text, r.control.signals.at(n));
    text += '\n';
  }
  files::write_result(path, record_kind, text);
}

void write_log(const std::filesystem::path& path, const FlightRecord& record, const ExperimentInfo& experiment,
               const std::string& channel_prefix) {
  // The last record gets the present wall-clock time.
  const double last_s = record.records.empty() ? 0.0 : record.records.back().time_s;
  LogOutlet outlet(path, wall_clock_us() - std::llround(last_s * 1e6));
  MessageStream stream({.channel_prefix = channel_prefix}, experiment, nullptr);
  stream.add(outlet);
  for (const rig::CycleRecord& r : record.records) stream.consume(r, rig::unknown);
  stream.report_fault(record.reason, record.reason_value, record.account);
  stream.finish();
}

}  // namespace

std::vector<std::filesystem::path> write_flight_record(const std::filesystem::path& prefix, const FlightRecord& record,
                                                       const ExperimentInfo& experiment,
                                                       const std::string& channel_prefix,
                                                       std::vector<std::string>& problems) {
  std::vector<std::filesystem::path> written;
  std::filesystem::path free = prefix;  // the run and its guardian may both have something to tell
  for (int number = 2; std::filesystem::exists(free.string() + ".txt"); ++number) {
    free = prefix.string() + '-' + std::to_string(number);
  }
  const auto attempt = [&](const char* extension, auto&& write) {
    std::filesystem::path path = free;
    path += extension;
    try {
      write(path);
      written.push_back(std::move(path));
    } catch (const std::exception& error) {
      problems.emplace_back(error.what());
    }
  };
  attempt(".txt", [&](const auto& path) {
    files::write_result(path, record_kind,
                        "reason " + std::to_string(static_cast<int>(record.reason)) + ": " +
                            rig::reason_with_value(record.reason, record.reason_value, experiment.names.signals) +
                            '\n' + record.account + std::to_string(record.records.size()) + " cycles recorded\n");
  });
  attempt(".csv", [&](const auto& path) { write_csv(path, record, experiment.names); });
  attempt(".lcmlog", [&](const auto& path) { write_log(path, record, experiment, channel_prefix); });
  return written;
}

}  // namespace abs_hil::telemetry

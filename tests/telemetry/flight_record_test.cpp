// The files of a flight record.

#include "telemetry/flight_record.hpp"

#include <array>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "catch.hpp"
#include "rig/reason_text.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/message_codec.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::telemetry;

namespace {

std::string content(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream rest(line);
  for (std::string field; std::getline(rest, field, ',');) fields.push_back(field);
  return fields;
}

/// The last row of the recorder's CSV, by column.
std::map<std::string, std::string> last_row(const std::filesystem::path& path) {
  std::istringstream lines(content(path));
  std::string header, row;
  std::getline(lines, header);
  for (std::string line; std::getline(lines, line);) row = line;
  const std::vector<std::string> names = fields_of(header), values = fields_of(row);
  REQUIRE(names.size() == values.size());
  std::map<std::string, std::string> by_name;
  for (std::size_t n = 0; n < names.size(); ++n) by_name[names[n]] = values[n];
  return by_name;
}

}  // namespace

TEST_CASE("the flight record has the controller's own signals, by their names") {
  const test::TemporaryFolder folder;
  std::array<rig::CycleRecord, 2> records{};
  records[1].sequence = 1;
  records[1].control.signals[0] = 0.25;
  records[1].control.signals[1] = -3.0;
  std::vector<std::string> problems;
  ExperimentInfo experiment{};
  experiment.names.signals = {"I_m", "zeta_N"};
  const double own = static_cast<double>(rig::controller_signals.size() + 1);
  const auto written = write_flight_record(
      folder.path / "flight",
      {.records = records, .reason = rig::Reason::controller_not_finite, .reason_value = own, .account = "a test\n"},
      experiment, "ABS_", problems);
  CHECK(problems.empty());
  CHECK(written.size() == 3);
  CHECK_THAT(content(folder.path / "flight.txt"), Catch::Matchers::Contains("not a finite number: zeta_N\n"));
  std::istringstream lines(content(folder.path / "flight.csv"));
  std::string header, first, second;
  std::getline(lines, header);
  std::getline(lines, first);
  std::getline(lines, second);
  CHECK(header == std::string(csv_header).append(flight_csv_extra_header).append(",I_m,zeta_N"));
  CHECK_THAT(first, Catch::Matchers::EndsWith(",NaN,NaN"));
  CHECK_THAT(second, Catch::Matchers::EndsWith(",0.25,-3"));
}

TEST_CASE("the record of a guardian does not replace that of its run") {
  const test::TemporaryFolder folder;
  std::vector<std::string> problems;
  for (const char* account : {"of the run\n", "of the guardian\n"}) {
    CHECK(
        write_flight_record(folder.path / "flight", {.records = {}, .account = account}, {}, "ABS_", problems).size() ==
        3);
  }
  CHECK(problems.empty());
  CHECK_THAT(content(folder.path / "flight.txt"), Catch::Matchers::Contains("of the run"));
  CHECK_THAT(content(folder.path / "flight-2.txt"), Catch::Matchers::Contains("of the guardian"));
  CHECK(std::filesystem::exists(folder.path / "flight-2.lcmlog"));
}

TEST_CASE("each further column of the flight record holds its own quantity") {
  const test::TemporaryFolder folder;
  rig::CycleRecord record{};
  record.sequence = 41;
  record.stamp_ns = 42;
  record.phase = rig::Phase::brake;
  record.measurement.upper_counts = 43;
  record.measurement.lower_counts = -44;
  record.measurement.supply_V = 23.5;
  record.measurement.temperature_C = 36.25;
  record.measurement.trip_flags = 5;
  record.reason = rig::Reason::board_interlock_tripped;
  record.reason_value = 1.5;
  record.timing.wakeup_latency_ns = 46'000;
  record.timing.cycle_ns = 47'500;
  ExperimentInfo experiment{};
  experiment.names.phases = {{rig::Phase::brake, "brake-low"}};
  experiment.names.signals = {"I_m"};
  std::vector<std::string> problems;
  write_flight_record(folder.path / "flight", {.records = {&record, 1}}, experiment, "ABS_", problems);
  CHECK(problems.empty());
  auto row = last_row(folder.path / "flight.csv");
  const std::map<std::string, std::string> expected{{"phase", "brake"},      {"phase_name", "brake-low"},
                                                    {"cycle", "41"},         {"stamp_ns", "42"},
                                                    {"upper_counts", "43"},  {"lower_counts", "-44"},
                                                    {"supply_V", "23.5"},    {"temperature_C", "36.25"},
                                                    {"trip_flags", "5"},     {"reason", "70"},
                                                    {"reason_value", "1.5"}, {"wakeup_latency_us", "46"},
                                                    {"cycle_us", "47.5"},    {"I_m", "NaN"}};
  for (const auto& [name, value] : expected) {
    CAPTURE(name);
    CHECK(row[name] == value);
  }
}

TEST_CASE("the flight record's log has each cycle and ends with the fault") {
  const test::TemporaryFolder folder;
  std::array<rig::CycleRecord, 3> records{};
  for (std::size_t n = 0; n < records.size(); ++n) {
    records[n].sequence = 100 + n;
    records[n].time_s = 1.0 + 1e-3 * static_cast<double>(n);
  }
  std::vector<std::string> problems;
  write_flight_record(folder.path / "flight",
                      {.records = records,
                       .reason = rig::Reason::overspeed,
                       .reason_value = 251.5,
                       .account = "the guardian stopped the run\n"},
                      ExperimentInfo{}, "ABS_", problems);
  CHECK(problems.empty());
  CHECK_THAT(content(folder.path / "flight.txt"),
             Catch::Matchers::Contains("the guardian stopped the run\n3 cycles recorded\n"));
  EventLogReader log(folder.path / "flight.lcmlog");
  std::vector<std::int64_t> cycles;
  event_t last{};
  while (const auto event = log.next()) {
    const auto size = static_cast<int>(event->data.size());
    if (event->channel == "ABS_TELEMETRY") {
      telemetry_t message{};
      REQUIRE(message.decode(event->data.data(), 0, size) == size);
      cycles.push_back(message.cycle);
    } else if (event->channel == "ABS_EVENT") {
      REQUIRE(last.decode(event->data.data(), 0, size) == size);
    }
  }
  CHECK(cycles == std::vector<std::int64_t>{100, 101, 102});
  CHECK(last.kind == "fault");
  CHECK(last.message == "the guardian stopped the run\n");
}

TEST_CASE("a file of the flight record that cannot be written is a problem, and the others are written") {
  const test::TemporaryFolder folder;
  std::filesystem::create_directory(folder.path / "flight.csv");
  const rig::CycleRecord record{};
  std::vector<std::string> problems;
  const auto written =
      write_flight_record(folder.path / "flight", {.records = {&record, 1}}, ExperimentInfo{}, "ABS_", problems);
  CHECK(written.size() == 2);
  REQUIRE(problems.size() == 1);
  CHECK_THAT(problems[0], Catch::Matchers::Contains("flight.csv"));
}

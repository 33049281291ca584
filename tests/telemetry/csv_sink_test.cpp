// A run's CSV: header, rows, extreme values.
#include "telemetry/csv_sink.hpp"

#include <bit>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "catch.hpp"
#include "telemetry/sample_records.hpp"
#include "temporary_folder.hpp"

namespace abs_hil::telemetry {
namespace {

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, ',');) fields.push_back(field);
  return fields;
}

std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::vector<std::string> lines;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::uint64_t bits_of(const std::string& text) {
  double value = 0.0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  CHECK(result.ptr == text.data() + text.size());
  return std::bit_cast<std::uint64_t>(value);
}

std::string row_of(const rig::CycleRecord& record, double distance_m) {
  char row[csv_row_max_bytes];
  return {row, format_csv_row(record, distance_m, row)};
}

TEST_CASE("the CSV header equals the published one exactly") {
  CHECK(csv_header ==
        "time_s,phase,omega1_rad_s,omega2_rad_s,omega1_est_rad_s,omega2_est_rad_s,slip,slip_est,slip_ref,"
        "brake_torque_Nm,brake_torque_ref_Nm,brake_torque_est_Nm,brake_pwm,motor_pwm,motor_enable,theta_N,theta_est_N,"
        "distance_m,slip_velocity_error_m_s,upper_counts,lower_counts,sample_valid,sample_time_s,wheels_apart");
}

TEST_CASE("the phase's own name and the controller's own signals follow the fixed columns, bit-exactly") {
  const abs_hil::test::TemporaryFolder scratch;
  rig::CycleRecord r = test::sample_record(7);
  r.control.signals = {1.0 / 3.0, rig::unknown, 5.0};
  r.phase_index = 1;
  const rig::RunNames names{.phases = {{rig::Phase::idle, "wait"}, {r.phase, "brake-low"}},
                            .signals = {"I_m", "zeta_N"}};
  {
    CsvSink sink(scratch / "run.csv", 0, names);
    sink.consume(r, 0.0);
    sink.finish();
  }
  const auto lines = lines_of(scratch / "run.csv");
  REQUIRE(lines.size() == 2);
  CHECK(lines[0] == std::string(csv_header) + ",phase_name,I_m,zeta_N");
  const auto fields = fields_of(lines[1]);
  REQUIRE(fields.size() == 27);
  CHECK(fields[24] == "brake-low");
  CHECK(bits_of(fields[25]) == std::bit_cast<std::uint64_t>(1.0 / 3.0));
  CHECK(fields[26] == "NaN");
}

TEST_CASE("every CSV column holds its quantity, bit-exactly") {
  const abs_hil::test::TemporaryFolder scratch;
  rig::CycleRecord r = test::sample_record(7);
  r.sample_valid = false;
  r.wheels_apart = true;
  const double distance_m = 1.0 / 7.0;
  {
    CsvSink sink(scratch / "run.csv");
    sink.consume(r, distance_m);
    sink.finish();
  }
  const auto lines = lines_of(scratch / "run.csv");
  REQUIRE(lines.size() == 2);
  CHECK(lines[0] == csv_header);
  const auto fields = fields_of(lines[1]);
  REQUIRE(fields.size() == fields_of(lines[0]).size());
  CHECK(fields[1] == "brake");
  CHECK(fields[14] == "1");
  CHECK(fields[19] == "1007");
  CHECK(fields[20] == "-2007");
  CHECK(fields[21] == "0");
  CHECK(fields[23] == "1");
  const std::vector<std::pair<std::size_t, double>> expected{{0, r.time_s},
                                                             {2, r.truth.speeds.omega1_rad_s},
                                                             {3, r.truth.speeds.omega2_rad_s},
                                                             {4, r.control.speeds_est.omega1_rad_s},
                                                             {5, r.control.speeds_est.omega2_rad_s},
                                                             {6, r.truth.slip},
                                                             {7, r.control.slip_est},
                                                             {8, r.control.slip_ref},
                                                             {9, r.truth.brake_torque_Nm},
                                                             {10, r.control.brake_torque_ref_Nm},
                                                             {11, r.control.brake_torque_est_Nm},
                                                             {12, r.command.brake_duty},
                                                             {13, r.command.motor_duty},
                                                             {15, r.truth.theta_N},
                                                             {16, r.control.theta_est_N},
                                                             {17, distance_m},
                                                             {18, r.control.slip_velocity_error_m_s},
                                                             {22, r.sample_time_s}};
  for (const auto& [column, value] : expected) {
    INFO("column " << column);
    CHECK(bits_of(fields[column]) == std::bit_cast<std::uint64_t>(value));
  }
}

TEST_CASE("unknown values are written as NaN, whatever the sign of the NaN") {
  rig::CycleRecord r;
  r.truth.slip = -std::numeric_limits<double>::quiet_NaN();
  CHECK(row_of(r, 0.0) == "0,idle,NaN,NaN,0,0,NaN,0,0,NaN,0,0,0,0,0,NaN,NaN,0,NaN,0,0,1,0,0\n");
}

TEST_CASE("extreme values fit a row and read back") {
  using Limits = std::numeric_limits<double>;
  rig::CycleRecord r = test::sample_record(0);
  r.phase = rig::Phase::accelerate;
  r.time_s = -1.2345678901234567e-308;
  r.truth.speeds = {-Limits::max(), Limits::denorm_min()};
  r.control.speeds_est = {-Limits::min(), -0.0};
  r.truth.slip = Limits::infinity();
  r.control.slip_est = -Limits::infinity();
  for (double* value : {&r.control.slip_ref, &r.truth.brake_torque_Nm, &r.control.brake_torque_ref_Nm,
                        &r.control.brake_torque_est_Nm, &r.command.brake_duty, &r.command.motor_duty, &r.truth.theta_N,
                        &r.control.theta_est_N, &r.control.slip_velocity_error_m_s, &r.sample_time_s}) {
    *value = -1.2345678901234567e-301;
  }
  const std::string row = row_of(r, -1.7976931348623157e+308);
  CHECK(row.size() < csv_row_max_bytes);
  const auto fields = fields_of(row.substr(0, row.size() - 1));
  REQUIRE(fields.size() == 24);
  CHECK(bits_of(fields[2]) == std::bit_cast<std::uint64_t>(-Limits::max()));
  CHECK(bits_of(fields[3]) == std::bit_cast<std::uint64_t>(Limits::denorm_min()));
  CHECK(bits_of(fields[5]) == std::bit_cast<std::uint64_t>(-0.0));
  CHECK(fields[6] == "inf");
  CHECK(fields[7] == "-inf");
}

TEST_CASE("rows survive the block boundaries of a long file, with or without finish()") {
  const abs_hil::test::TemporaryFolder scratch;
  constexpr std::uint64_t rows = 2000;  // some ten blocks
  for (const bool finish : {true, false}) {
    {
      CsvSink sink(scratch / "long.csv");
      for (std::uint64_t i = 0; i < rows; ++i) sink.consume(test::sample_record(i), 0.5);
      if (finish) sink.finish();
    }
    const auto lines = lines_of(scratch / "long.csv");
    REQUIRE(lines.size() == rows + 1);
    for (std::uint64_t i = 0; i < rows; ++i) REQUIRE(lines[i + 1] + "\n" == row_of(test::sample_record(i), 0.5));
  }
}

TEST_CASE("with a write period the file is never further behind than that, and ends with a whole row") {
  const abs_hil::test::TemporaryFolder scratch;
  constexpr std::int64_t period_ns = 50'000'000;
  constexpr std::int64_t cycle_ns = 1'000'000;
  CsvSink sink(scratch / "run.csv", period_ns);
  for (std::uint64_t i = 0; i < 400; ++i) {
    rig::CycleRecord record = test::sample_record(i);
    record.stamp_ns = static_cast<std::int64_t>(i + 1) * cycle_ns;
    sink.consume(record, 0.0);
    const auto lines = lines_of(scratch / "run.csv");  // what a reader finds if the program is killed now
    if (i < 50) continue;
    REQUIRE(lines.size() + 50 >= i + 2);
    REQUIRE(lines.back() + "\n" == row_of(test::sample_record(lines.size() - 2), 0.0));
  }
}

TEST_CASE("an older file stays until the run has begun, and until the new one is whole") {
  const abs_hil::test::TemporaryFolder scratch;
  const auto path = scratch / "run.csv";
  const auto older = [&path] { return lines_of(path) == std::vector<std::string>{"older"}; };
  std::ofstream(path) << "older\n";
  for (const std::int64_t period_ns : {0, 50'000'000}) {
    {
      CsvSink refused(path, period_ns);
    }  // the run never begins
    CHECK(older());
  }
  {
    CsvSink sink(path);
    for (std::uint64_t i = 0; i < 1000; ++i) sink.consume(test::sample_record(i), 0.0);
    CHECK(older());
    sink.finish();
  }
  CHECK(lines_of(path).size() == 1001);
  CHECK(std::distance(std::filesystem::directory_iterator(scratch.path), std::filesystem::directory_iterator()) == 1);
}

TEST_CASE("rows that did not reach the disk are counted") {
  CsvSink sink("/dev/full", 10'000'000);
  for (std::uint64_t i = 0; i < 100; ++i) {
    rig::CycleRecord record = test::sample_record(i);
    record.stamp_ns = static_cast<std::int64_t>(i + 1) * 1'000'000;
    sink.consume(record, 0.0);
  }
  CHECK_THROWS_AS(sink.finish(), files::FileError);
  CHECK(sink.rows_lost() == 100);
}

TEST_CASE("finish() reports a full disk") {
  CsvSink sink("/dev/full");
  for (std::uint64_t i = 0; i < 1000; ++i) sink.consume(test::sample_record(i), 0.0);
  CHECK(sink.rows_lost() == 1000);
  try {
    sink.finish();
    FAIL("finish() must throw");
  } catch (const files::FileError& error) {
    CHECK(error.error_number() == ENOSPC);
    CHECK_THAT(error.what(), Catch::Matchers::Contains("/dev/full") && Catch::Matchers::Contains("No space left") &&
                                 Catch::Matchers::Contains("free some space"));
  }
}

TEST_CASE("a full disk is noticed even if everything fitted the buffer") {
  CsvSink sink("/dev/full");
  sink.consume(test::sample_record(0), 0.0);
  CHECK_THROWS_AS(sink.finish(), files::FileError);
}

TEST_CASE("a path that cannot be opened is refused with path, reason and fix") {
  const abs_hil::test::TemporaryFolder scratch;
  const auto missing = scratch.path / "nowhere" / "run.csv";
  CHECK_THROWS_WITH(CsvSink(missing), Catch::Matchers::Contains(missing.string()) &&
                                          Catch::Matchers::Contains("No such file or directory") &&
                                          Catch::Matchers::Contains("mkdir -p"));
  CHECK_THROWS_WITH(CsvSink(scratch.path), Catch::Matchers::Contains("add a file name"));
  CHECK_THROWS_WITH(CsvSink("/dev/null/run.csv"), Catch::Matchers::Contains("choose another path"));
}

TEST_CASE("a directory without write permission is refused") {
  if (::geteuid() == 0) {
    WARN("skipped: root may write anywhere");
    return;
  }
  const abs_hil::test::TemporaryFolder scratch;
  std::filesystem::permissions(scratch.path, std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  CHECK_THROWS_WITH(CsvSink(scratch / "run.csv"), Catch::Matchers::Contains("Permission denied"));
  std::filesystem::permissions(scratch.path, std::filesystem::perms::owner_all);
}

}  // namespace
}  // namespace abs_hil::telemetry
